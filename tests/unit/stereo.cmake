find_package(OpenCV REQUIRED COMPONENTS core imgcodecs)
groundline_test(stereo
                SOURCES unit/stereo_census_matcher_test.cpp unit/stereo_census_kernels_test.cpp
                        unit/stereo_census_properties_test.cpp
                        unit/stereo_census_real_test.cpp unit/stereo_halve_test.cpp unit/stereo_thin_things_test.cpp
                        unit/stereo_paper_properties_test.cpp unit/stereo_paper_matcher_test.cpp
                        unit/stereo_kernels_test.cpp unit/stereo_plain_kernels.cpp unit/stereo_checks_test.cpp
                        unit/stereo_local_mean_test.cpp unit/stereo_real_pairs_test.cpp
                        unit/stereo_speckle_test.cpp unit/stereo_window_sums_test.cpp
                        support/allocation_count.cpp
                USES stereo
                LIBS opencv_core opencv_imgcodecs)

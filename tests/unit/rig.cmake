find_package(OpenCV REQUIRED COMPONENTS core calib3d imgproc imgcodecs)
groundline_test(rig
  SOURCES unit/rig_body_mask_test.cpp unit/rig_pair_monitor_test.cpp unit/rig_repeats_test.cpp unit/rig_chessboard_test.cpp unit/rig_lens_test.cpp unit/rig_photometric_test.cpp unit/rig_range_test.cpp
          unit/rig_rectification_test.cpp unit/rig_rectifier_test.cpp unit/rig_usable_test.cpp
          support/allocation_count.cpp
  USES rig
  LIBS opencv_core opencv_calib3d opencv_imgproc opencv_imgcodecs)

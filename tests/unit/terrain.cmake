groundline_test(terrain
  SOURCES unit/terrain_v_disparity_test.cpp unit/terrain_ground_test.cpp unit/terrain_hough_test.cpp unit/terrain_components_test.cpp unit/terrain_outline_test.cpp unit/terrain_shares_test.cpp
          unit/terrain_classifier_test.cpp unit/terrain_sectors_test.cpp unit/terrain_persistence_test.cpp support/allocation_count.cpp
          unit/terrain_kernels_test.cpp unit/terrain_surface_test.cpp
  USES terrain stereo)

groundline_test(terrain
  SOURCES unit/terrain_v_disparity_test.cpp unit/terrain_ground_test.cpp support/allocation_count.cpp
  USES terrain)

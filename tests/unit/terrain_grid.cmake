groundline_test(terrain_grid
  SOURCES unit/terrain_grid_test.cpp support/allocation_count.cpp
  USES terrain synth)

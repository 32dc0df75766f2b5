groundline_test(terrain_grid
  SOURCES unit/terrain_grid_test.cpp support/allocation_count.cpp
  USES terrain synth)
groundline_test(terrain_grid_pipeline
  SOURCES unit/terrain_grid_pipeline_test.cpp
  USES pipeline synth)

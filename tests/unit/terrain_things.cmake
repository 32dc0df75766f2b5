groundline_test(terrain_things
  SOURCES unit/terrain_obstacles_test.cpp unit/terrain_pictures_test.cpp
  USES terrain stereo synth)

groundline_test(synth
  SOURCES unit/synth_scene_test.cpp unit/synth_geometry_test.cpp unit/synth_picture_test.cpp
  USES synth)

find_package(fmt REQUIRED)
find_package(nlohmann_json 3 REQUIRED)
groundline_test(synth_command
  SOURCES unit/synth_command_test.cpp ${PROJECT_SOURCE_DIR}/src/cli/synth_command.cpp
          ${PROJECT_SOURCE_DIR}/src/cli/interrupt.cpp
  USES io pipeline synth
  LIBS fmt::fmt nlohmann_json::nlohmann_json)

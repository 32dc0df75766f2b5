# From the sources, not the cli room: the test has a replay of its own.
set(cli ${PROJECT_SOURCE_DIR}/src/cli)
find_package(CLI11 REQUIRED)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
groundline_test(evaluate
  SOURCES unit/evaluate_test.cpp unit/evaluation_test.cpp ${cli}/evaluate_command.cpp ${cli}/evaluate_options.cpp
          ${cli}/evaluate_set.cpp ${cli}/evaluation.cpp ${cli}/truth_ground.cpp
  USES io calibration rig core
  LIBS fmt::fmt CLI11::CLI11 nlohmann_json::nlohmann_json)

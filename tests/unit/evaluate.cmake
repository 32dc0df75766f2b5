# From the sources, not the cli room: the test has a replay of its own.
set(cli ${PROJECT_SOURCE_DIR}/src/cli)
find_package(CLI11 REQUIRED)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(OpenCV 4.6 REQUIRED COMPONENTS core calib3d imgproc)
groundline_test(evaluate
  SOURCES unit/evaluate_test.cpp unit/evaluation_test.cpp unit/evaluate_matchers_test.cpp
          unit/evaluate_perturbation_test.cpp unit/evaluate_terrain_test.cpp
          ${cli}/compared_matchers.cpp ${cli}/evaluate_command.cpp
          ${cli}/evaluate_options.cpp ${cli}/evaluate_set.cpp ${cli}/evaluation.cpp ${cli}/figures.cpp
          ${cli}/interrupt.cpp
          ${cli}/matcher_table.cpp ${cli}/perturbation.cpp ${cli}/plane_search.cpp
          ${cli}/step_progress.cpp ${cli}/terrain_baseline.cpp ${cli}/terrain_judge.cpp ${cli}/terrain_run.cpp
          ${cli}/terrain_suite.cpp ${cli}/terrain_table.cpp ${cli}/truth_ground.cpp ${cli}/truth_labels.cpp
          ${cli}/truth_sets.cpp
  USES setup settings capture pipeline stereo synth io calibration rig core
  LIBS fmt::fmt CLI11::CLI11 nlohmann_json::nlohmann_json opencv_core opencv_calib3d opencv_imgproc)

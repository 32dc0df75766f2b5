find_package(OpenCV REQUIRED COMPONENTS core)
groundline_test(calibration
  SOURCES unit/calibration_find_test.cpp unit/calibration_malformed_test.cpp unit/calibration_reader_test.cpp
          unit/calibration_real_test.cpp
  USES calibration
  LIBS opencv_core)

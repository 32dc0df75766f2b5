find_package(JPEG REQUIRED)
groundline_test(capture_v4l2
  SOURCES unit/capture_v4l2_test.cpp support/allocation_count.cpp
  USES capture core LIBS JPEG::JPEG)

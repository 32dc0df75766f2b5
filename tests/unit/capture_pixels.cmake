find_package(JPEG REQUIRED)
groundline_test(capture_pixels
  SOURCES unit/capture_pixel_formats_test.cpp unit/capture_mjpeg_test.cpp support/allocation_count.cpp
  USES capture core LIBS JPEG::JPEG)

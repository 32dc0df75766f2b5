groundline_test(capture_source SOURCES unit/capture_camera_source_test.cpp support/allocation_count.cpp USES capture core)

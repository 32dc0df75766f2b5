groundline_test(capture_synthetic SOURCES unit/capture_synthetic_test.cpp support/allocation_count.cpp USES capture)

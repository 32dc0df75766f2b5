groundline_test(capture_pairing SOURCES unit/capture_pairing_test.cpp support/allocation_count.cpp USES capture core)

groundline_test(capture_files SOURCES unit/capture_files_test.cpp USES capture io core)

groundline_test(core_snapshot SOURCES unit/core_snapshot_test.cpp USES core LIBS Threads::Threads)

groundline_test(verdict SOURCES unit/verdict_liveness_test.cpp unit/verdict_overload_test.cpp unit/verdict_test.cpp USES verdict core)

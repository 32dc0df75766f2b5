groundline_test(verdict SOURCES unit/verdict_test.cpp USES verdict core)

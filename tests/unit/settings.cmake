groundline_test(settings SOURCES unit/settings_test.cpp USES settings)

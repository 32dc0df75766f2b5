groundline_test(lint SOURCES lint/layering.cpp lint/layering_test.cpp)

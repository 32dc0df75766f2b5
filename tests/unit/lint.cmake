groundline_test(lint SOURCES lint/layering.cpp lint/layering_test.cpp)

# The scripts of tests/tools, in their own language; absent where there is no Python.
find_package(Python3 COMPONENTS Interpreter)
if(Python3_FOUND)
  add_test(NAME tools.scripts COMMAND Python3::Interpreter ${CMAKE_CURRENT_LIST_DIR}/../tools/tools_test.py)
endif()

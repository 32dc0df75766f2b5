groundline_test(daemon SOURCES daemon/daemon_test.cpp daemon/service.cpp replay/program.cpp LIBS groundline_lcmtypes)
target_compile_definitions(test_daemon PRIVATE GROUNDLINE_PROGRAM="$<TARGET_FILE:groundline>"
                                               GROUNDLINED_PROGRAM="$<TARGET_FILE:groundlined>")
add_dependencies(test_daemon groundline groundlined)

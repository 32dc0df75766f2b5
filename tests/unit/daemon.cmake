groundline_test(daemon SOURCES daemon/daemon_test.cpp daemon/service.cpp replay/program.cpp LIBS groundline_lcmtypes)
add_library(forbidden_preload MODULE support/forbidden_preload.cpp)
target_link_libraries(forbidden_preload PRIVATE ${CMAKE_DL_LIBS})
target_compile_definitions(test_daemon PRIVATE GROUNDLINE_PROGRAM="$<TARGET_FILE:groundline>"
                                               GROUNDLINE_EMULATOR="$<JOIN:${CMAKE_CROSSCOMPILING_EMULATOR}, >"
                                               GROUNDLINED_PROGRAM="$<TARGET_FILE:groundlined>"
                                               GROUNDLINE_FORBIDDEN_PRELOAD="$<TARGET_FILE:forbidden_preload>")
add_dependencies(test_daemon groundline groundlined forbidden_preload)
groundline_test(daemon_parts SOURCES unit/daemon_parts_test.cpp USES daemon publish)

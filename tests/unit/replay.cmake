find_package(OpenCV 4.6 REQUIRED COMPONENTS core imgcodecs videoio)
groundline_test(replay SOURCES replay/bad_input_test.cpp replay/contract_test.cpp replay/program.cpp USES io
                LIBS opencv_core opencv_imgcodecs opencv_videoio)
target_compile_definitions(test_replay PRIVATE GROUNDLINE_PROGRAM="$<TARGET_FILE:groundline>"
                                               GROUNDLINE_EMULATOR="$<JOIN:${CMAKE_CROSSCOMPILING_EMULATOR}, >")
add_dependencies(test_replay groundline)

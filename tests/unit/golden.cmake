# Hashes that hold on every processor: what ./dev cross runs emulated.
groundline_test(golden SOURCES golden/golden_test.cpp unit/stereo_golden_test.cpp
                USES pipeline publish stereo synth)

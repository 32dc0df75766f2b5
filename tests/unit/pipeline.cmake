groundline_test(pipeline SOURCES unit/pipeline_attitude_test.cpp unit/pipeline_guards_test.cpp unit/pipeline_half_resolution_test.cpp unit/pipeline_hand_over_test.cpp unit/pipeline_interleavings_test.cpp unit/pipeline_processor_test.cpp unit/pipeline_run_test.cpp
                unit/pipeline_worker_pool_test.cpp support/allocation_count.cpp support/interleavings.cpp USES pipeline synth)

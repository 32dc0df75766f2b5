groundline_test(publish
  SOURCES unit/publish_mask_codec_test.cpp unit/publish_messages_test.cpp unit/publish_health_test.cpp
          unit/publish_attitude_test.cpp unit/publish_lcm_test.cpp support/allocation_count.cpp
  USES publish core
  LIBS groundline_lcmtypes)

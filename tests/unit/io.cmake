# The tests write images in other formats and videos, for which they use OpenCV themselves.
find_package(OpenCV 4.6 REQUIRED COMPONENTS core imgcodecs videoio)
groundline_test(io
  SOURCES unit/io_png_test.cpp unit/io_pairs_test.cpp unit/io_bad_input_test.cpp
          unit/io_picture_test.cpp unit/io_body_mask_test.cpp unit/io_result_writer_test.cpp unit/io_truth_test.cpp
  USES io core
  LIBS opencv_core opencv_imgcodecs opencv_videoio)

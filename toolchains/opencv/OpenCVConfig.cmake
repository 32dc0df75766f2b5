# OpenCV of a sysroot that holds modules of it: the configuration that Debian packages is in libopencv-dev, which brings
# every module, and refuses where one is missing.
set(OpenCV_LIBS "")
set(libraries "${CMAKE_SYSROOT}/usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}")
foreach(component IN LISTS OpenCV_FIND_COMPONENTS)
  set(library "${libraries}/libopencv_${component}.so")
  if(EXISTS "${library}")
    if(NOT TARGET opencv_${component})
      add_library(opencv_${component} SHARED IMPORTED)
      set_target_properties(opencv_${component} PROPERTIES
                            IMPORTED_LOCATION "${library}"
                            INTERFACE_INCLUDE_DIRECTORIES "${CMAKE_SYSROOT}/usr/include/opencv4")
    endif()
    set(OpenCV_${component}_FOUND TRUE)
    list(APPEND OpenCV_LIBS opencv_${component})
  elseif(OpenCV_FIND_REQUIRED_${component})
    set(OpenCV_FOUND FALSE)
    set(OpenCV_NOT_FOUND_MESSAGE "${library} is missing: the sysroot needs libopencv-${component}-dev")
  endif()
endforeach()

# find_package(groundline) gives groundline::lcmtypes: the headers groundline/mask_t.hpp and so on, groundline/mask_decoder.hpp,
# and LCM itself. groundline_LCMTYPES is the folder of the .lcm files, for lcm-gen in other languages.
get_filename_component(_groundline_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
set(groundline_LCMTYPES ${_groundline_prefix}/share/groundline/lcmtypes)
# LCM as packaged by Debian brings no CMake package of its own.
find_path(groundline_LCM_INCLUDE_DIR lcm/lcm_coretypes.h)
find_library(groundline_LCM_LIBRARY lcm)
mark_as_advanced(groundline_LCM_INCLUDE_DIR groundline_LCM_LIBRARY)
if(NOT groundline_LCM_INCLUDE_DIR OR NOT groundline_LCM_LIBRARY)
  set(groundline_FOUND FALSE)
  set(groundline_NOT_FOUND_MESSAGE "LCM was not found: install liblcm-dev")
elseif(NOT TARGET groundline::lcmtypes)
  add_library(groundline::lcmtypes INTERFACE IMPORTED)
  set_target_properties(groundline::lcmtypes PROPERTIES
    INTERFACE_INCLUDE_DIRECTORIES "${_groundline_prefix}/include;${groundline_LCM_INCLUDE_DIR}"
    INTERFACE_LINK_LIBRARIES "${groundline_LCM_LIBRARY}")
endif()
unset(_groundline_prefix)

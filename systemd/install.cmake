# Writes the units for the prefix that is being installed to: only then it is known, packages have /usr.
# Takes CMAKE_INSTALL_PREFIX, WRITTEN (a folder of ours) and SBIN where the programs are not in the prefix.
if(NOT SBIN)
  set(SBIN ${CMAKE_INSTALL_PREFIX}/sbin)
endif()


# WORDS: what groundlined is called with; IN_PLACE_OF: the unit that is stopped, and has ended, before it starts.
function(write_unit template name)
  cmake_parse_arguments(UNIT "" "DESCRIPTION;WORDS;IN_PLACE_OF" "" ${ARGN})
  foreach(part DESCRIPTION WORDS)
    set(${part} "${UNIT_${part}}")
  endforeach()
  set(CONFLICTS)
  if(UNIT_IN_PLACE_OF)
    set(CONFLICTS "Conflicts=${UNIT_IN_PLACE_OF}\nAfter=${UNIT_IN_PLACE_OF}")
  endif()
  configure_file(${CMAKE_CURRENT_LIST_DIR}/${template}.in ${WRITTEN}/${name} @ONLY)
  file(INSTALL ${WRITTEN}/${name} DESTINATION ${CMAKE_INSTALL_PREFIX}/lib/systemd/system)
endfunction()

set(what "groundline: what a robot's cameras say it must not drive into")
set(config "--config /etc/groundline/groundline.yaml")
write_unit(groundlined.service groundlined.service DESCRIPTION "${what}" WORDS "${config}")
# One for each of several rigs: groundlined@front reads front.yaml.
write_unit(groundlined.service groundlined@.service DESCRIPTION "${what} (rig %i)"
           WORDS "--config /etc/groundline/%i.yaml")
# A recording as if live, in the daemon's place: groundline-replay@$(systemd-escape --path FOLDER).
write_unit(groundlined.service groundline-replay@.service DESCRIPTION "groundline: replay of %f as if live"
           WORDS "${config} --set capture.driver=files --set capture.source=%f" IN_PLACE_OF groundlined.service)
write_unit(groundline-lcm-route.service groundline-lcm-route.service)

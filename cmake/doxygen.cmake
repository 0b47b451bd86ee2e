# The target `docs`: API pages of the headers in <build>/docs/html, without a warning. Where doxygen is not installed the
# target prints how to get it.
find_program(DOXYGEN doxygen)
if(DOXYGEN)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/Doxyfile.in ${CMAKE_BINARY_DIR}/generated/Doxyfile @ONLY)
  add_custom_target(docs COMMAND ${DOXYGEN} ${CMAKE_BINARY_DIR}/generated/Doxyfile VERBATIM)
else()
  add_custom_target(docs COMMAND ${CMAKE_COMMAND} -E echo "doxygen is missing: apt-get install doxygen" COMMAND ${CMAKE_COMMAND} -E false VERBATIM)
endif()

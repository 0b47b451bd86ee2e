# Writes OUTPUT: VERSION and a digest of the sources under SOURCE_DIR. Needs no git, and a commit that changes no
# source leaves it as it is, so that studies go on.
file(GLOB_RECURSE sources LIST_DIRECTORIES false RELATIVE ${SOURCE_DIR}
  ${SOURCE_DIR}/src/*.cpp ${SOURCE_DIR}/src/*.h ${SOURCE_DIR}/include/*.h)
list(SORT sources)
set(all "")
foreach(source ${sources})
  file(SHA256 ${SOURCE_DIR}/${source} digest)
  string(APPEND all "${source} ${digest}\n")
endforeach()
string(SHA256 DIGEST "${all}")
string(SUBSTRING ${DIGEST} 0 16 DIGEST)
configure_file(${CMAKE_CURRENT_LIST_DIR}/version.cpp.in ${OUTPUT} @ONLY)

# A module is a folder src/<module> with its headers in include/assembly_cell/<module>. It sees the headers of the
# modules that it names and of those that these name, nothing above: each has an include folder of its own in the build
# tree, with a link to its headers. An include that points upward does not build.

# The headers and object library module_<name> of the folder <path>. In a unity build up to <batch> files are compiled
# as one.
function(assembly_cell_module name path batch)
  set(headers ${CMAKE_BINARY_DIR}/modules/${name}/assembly_cell/${path})
  get_filename_component(parent ${headers} DIRECTORY)
  file(MAKE_DIRECTORY ${parent})
  file(CREATE_LINK ${PROJECT_SOURCE_DIR}/include/assembly_cell/${path} ${headers} SYMBOLIC)
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cpp)
  add_library(module_${name} OBJECT ${sources})
  set_target_properties(module_${name} PROPERTIES UNITY_BUILD ${ASSEMBLY_CELL_UNITY} UNITY_BUILD_BATCH_SIZE ${batch})
  target_include_directories(module_${name} PUBLIC ${CMAKE_BINARY_DIR}/modules/${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
endfunction()

# add_module(NAME [APART] [APART_FOLDERS folder...] [MODULES module...] [LIBRARIES library...]): a module of the core, which
# has no ROS. APART: the cell runs without it, or without these folders of it; they are in assembly_cell_core only.
function(add_module name)
  cmake_parse_arguments(module "APART" "" "APART_FOLDERS;MODULES;LIBRARIES" ${ARGN})
  assembly_cell_module(${name} ${name} 8)
  if(NOT name STREQUAL base)
    target_precompile_headers(module_${name} REUSE_FROM module_base)
  endif()
  list(TRANSFORM module_MODULES PREPEND module_)
  target_link_libraries(module_${name} PUBLIC ${module_MODULES} ${module_LIBRARIES})
  set(library cell)
  if(module_APART)
    set(library core)
  endif()
  target_sources(assembly_cell_${library} PRIVATE $<TARGET_OBJECTS:module_${name}>)
  if(module_APART_FOLDERS)
    list(JOIN module_APART_FOLDERS | folders)
    get_target_property(sources module_${name} SOURCES)
    set(apart ${sources})
    list(FILTER sources EXCLUDE REGEX "/(${folders})/")
    list(FILTER apart INCLUDE REGEX "/(${folders})/")
    set_target_properties(module_${name} PROPERTIES SOURCES "${sources}")
    add_library(module_${name}_apart OBJECT ${apart})
    set_target_properties(module_${name}_apart PROPERTIES UNITY_BUILD ${ASSEMBLY_CELL_UNITY})
    target_include_directories(module_${name}_apart PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
    target_precompile_headers(module_${name}_apart REUSE_FROM module_base)
    target_link_libraries(module_${name}_apart PRIVATE module_${name})
    target_sources(assembly_cell_core PRIVATE $<TARGET_OBJECTS:module_${name}_apart>)
  endif()
endfunction()

# add_ros_module(NAME MODULES module...): the folder src/ros/NAME as the module ros_NAME. Others name it so, too.
function(add_ros_module name)
  cmake_parse_arguments(module "" "" "MODULES" ${ARGN})
  assembly_cell_module(ros_${name} ros/${name} 12)  # headers of ROS cost most of a compilation
  if(NOT name STREQUAL bridge)
    target_precompile_headers(module_ros_${name} REUSE_FROM module_ros_bridge)
  endif()
  list(TRANSFORM module_MODULES PREPEND module_)
  target_link_libraries(module_ros_${name} PUBLIC ${module_MODULES})
  needs_messages(module_ros_${name})
  set_property(GLOBAL APPEND PROPERTY ASSEMBLY_CELL_ROS_OBJECTS $<TARGET_OBJECTS:module_ros_${name}>)
endfunction()

# A right-hand side is small functions with vectors between them: inline they stay in registers, 2 to 3 % of a run.
function(inline_small_functions target)
  if(CMAKE_CXX_COMPILER_ID STREQUAL Clang)
    target_compile_options(${target} PRIVATE "SHELL:-mllvm -inline-threshold=500")
  endif()
endfunction()

# needs_messages(TARGET): the package's messages are generated first.
function(needs_messages target)
  add_dependencies(${target} ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
endfunction()

# package_program(TARGET): an executable that rosrun finds, installed with the package.
function(package_program target)
  set_target_properties(${target} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION})
  install(TARGETS ${target} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
  add_dependencies(programs ${target})
endfunction()
add_custom_target(programs)

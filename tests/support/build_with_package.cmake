# Installs the development files into a separate directory. Then builds and runs a project that uses only these files. Usage: cmake -DBINARY_DIR=... -DSOURCE_DIR=... -DWORK_DIR=... -DCOMPILER=... -DFLAGS=... -P build.cmake
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE out ERROR_VARIABLE out)
  message("${out}")
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "failed: ${ARGN}")
  endif()
endfunction()

file(REMOVE_RECURSE ${WORK_DIR})
run(${CMAKE_COMMAND} --install ${BINARY_DIR} --prefix ${WORK_DIR}/installed --component development)
# Moves the installed files: they must not contain their first path.
file(RENAME ${WORK_DIR}/installed ${WORK_DIR}/elsewhere)
run(${CMAKE_COMMAND} -S ${SOURCE_DIR} -B ${WORK_DIR}/build -DCMAKE_PREFIX_PATH=${WORK_DIR}/elsewhere
    -DCMAKE_CXX_COMPILER=${COMPILER} "-DCMAKE_CXX_FLAGS=${FLAGS}")
run(${CMAKE_COMMAND} --build ${WORK_DIR}/build)
run(${WORK_DIR}/build/somebody_else)
file(REMOVE_RECURSE ${WORK_DIR})

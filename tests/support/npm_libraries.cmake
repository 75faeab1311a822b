# Installs the npm libraries that package.json and package-lock.json of the current directory name, during the build, and sets
# `directory` to where they are.
function(wrenchd_npm_libraries target directory)
  set(libraries ${CMAKE_CURRENT_BINARY_DIR}/libraries)
  add_custom_command(OUTPUT ${libraries}/installed
    COMMAND ${CMAKE_COMMAND} -E make_directory ${libraries}
    COMMAND ${CMAKE_COMMAND} -E copy ${CMAKE_CURRENT_SOURCE_DIR}/package.json ${CMAKE_CURRENT_SOURCE_DIR}/package-lock.json
            ${libraries}
    COMMAND ${CMAKE_COMMAND} -E chdir ${libraries} ${NPM} ci --ignore-scripts --no-audit --no-fund --silent
    COMMAND ${CMAKE_COMMAND} -E touch ${libraries}/installed
    DEPENDS package.json package-lock.json VERBATIM)
  add_custom_target(${target} ALL DEPENDS ${libraries}/installed)
  set(${directory} ${libraries} PARENT_SCOPE)
endfunction()

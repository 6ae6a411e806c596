# cmake -DIN=file -DOUT=file.cpp -DNAME=name -P Embed.cmake: the bytes of a file as tunica::report::embedded::NAME.
file(READ ${IN} bytes HEX)
string(REGEX REPLACE "(................................)" "\\1\n" bytes "${bytes}")
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
file(WRITE ${OUT} "#include \"tunica/report/detail/embedded.hpp\"

namespace tunica::report::embedded {
namespace {
constexpr unsigned char bytes_of_${NAME}[] = {
${bytes}};
}  // namespace

std::string_view ${NAME}() {
  return {reinterpret_cast<const char*>(bytes_of_${NAME}), sizeof(bytes_of_${NAME})};
}
}  // namespace tunica::report::embedded
")

#include "tunica/io/result/detail/vtu_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/file/signed_file.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>
#include <zlib.h>

#include <bit>
#include <new>

namespace tunica {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::size_t block_bytes = std::size_t{1} << 20;
constexpr int fast = 1;  // smooth fields compress well at once, and more effort gains little

std::string base64(std::string_view bytes) {
  std::string text;
  constexpr std::size_t piece = 3 * (std::size_t{1} << 20);  // whole triples, so that the pieces join
  for (std::size_t start = 0; start < bytes.size(); start += piece) {
    const std::string_view part = bytes.substr(start, piece);
    std::string encoded(4 * ((part.size() + 2) / 3) + 1, '\0');
    const int length = EVP_EncodeBlock(reinterpret_cast<unsigned char*>(encoded.data()),
                                       reinterpret_cast<const unsigned char*>(part.data()), narrow<int>(part.size()));
    text += encoded.substr(0, narrow<std::size_t>(length));
  }
  return text;
}

// The sizes of the blocks, and the compressed blocks, each in base64 of its own.
std::string compressed(std::string_view bytes) {
  std::vector<std::uint64_t> head{(bytes.size() + block_bytes - 1) / block_bytes, block_bytes,
                                  bytes.size() % block_bytes};
  std::string blocks;
  for (std::size_t start = 0; start < bytes.size(); start += block_bytes) {
    const std::string_view block = bytes.substr(start, block_bytes);
    uLongf size = ::compressBound(block.size());
    std::string packed(size, '\0');
    const int status = ::compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                                   reinterpret_cast<const Bytef*>(block.data()), block.size(), fast);
    if (status == Z_MEM_ERROR) {
      throw std::bad_alloc();
    }
    TUNICA_ASSERT(status == Z_OK);
    head.push_back(size);
    blocks.append(packed, 0, size);
  }
  return base64({reinterpret_cast<const char*>(head.data()), head.size() * sizeof(std::uint64_t)}) + base64(blocks);
}

template <typename Value>
constexpr const char* type_name() {
  if constexpr (std::is_same_v<Value, float>) {
    return "Float32";
  } else if constexpr (std::is_same_v<Value, double>) {
    return "Float64";
  } else if constexpr (std::is_same_v<Value, std::int32_t>) {
    return "Int32";
  } else {
    return "UInt8";
  }
}

class Document {
public:
  void line(const std::string& text) { xml_ += text + "\n"; }

  // @param tuples  only of field data, which has no points or cells to count
  void array(const VtuArray& array, bool tuples = false) {
    std::visit(
        [&]<typename Value>(std::span<const Value> values) {
          line(fmt::format(
              R"(<DataArray type="{}" Name="{}" NumberOfComponents="{}"{} format="appended" offset="{}"/>)",
              type_name<Value>(), array.name, array.components,
              tuples ? fmt::format(R"( NumberOfTuples="{}")", values.size() / array.components) : "", data_.size()));
          data_ += compressed({reinterpret_cast<const char*>(values.data()), values.size_bytes()});
        },
        array.values);
  }

  void section(const char* name, const std::vector<VtuArray>& arrays) {
    line(fmt::format("<{}>", name));
    for (const VtuArray& one : arrays) {
      array(one, std::string_view(name) == "FieldData");
    }
    line(fmt::format("</{}>", name));
  }

  [[nodiscard]] std::string str() const {
    return xml_ + "<AppendedData encoding=\"base64\">\n_" + data_ + "\n</AppendedData>\n</VTKFile>\n";
  }

private:
  std::string xml_;
  std::string data_;
};

}  // namespace

void write_vtu(const std::filesystem::path& path, const VtuGrid& grid, const std::string& made_by, bool overwrite) {
  Document document;
  document.line(R"(<?xml version="1.0"?>)");
  document.line(
      R"(<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64" compressor="vtkZLibDataCompressor">)");
  document.line("<UnstructuredGrid>");
  document.section("FieldData", grid.of_grid);
  document.line(
      fmt::format(R"(<Piece NumberOfPoints="{}" NumberOfCells="{}">)", grid.coordinates.size() / 3, grid.types.size()));
  document.section("PointData", grid.of_points);
  document.section("CellData", grid.of_cells);
  document.section("Points", {{"Points", 3, grid.coordinates}});
  document.section("Cells",
                   {{"connectivity", 1, grid.connectivity}, {"offsets", 1, grid.ends}, {"types", 1, grid.types}});
  document.line("</Piece>");
  document.line("</UnstructuredGrid>");
  write_file(path, document.str() + xml_made_by(made_by), overwrite);
}

}  // namespace tunica

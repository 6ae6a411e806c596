#include "tunica/io/file/encoding.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <openssl/evp.h>
#include <zlib.h>

#include <new>

namespace tunica {
namespace {

const unsigned char* bytes_of(std::string_view text) { return reinterpret_cast<const unsigned char*>(text.data()); }

}  // namespace

std::string deflated(std::string_view bytes) {
  uLongf size = compressBound(bytes.size());
  std::string packed(size, '\0');
  const int code = compress2(reinterpret_cast<Bytef*>(packed.data()), &size, bytes_of(bytes), bytes.size(), 9);
  if (code == Z_MEM_ERROR) {
    throw std::bad_alloc();
  }
  TUNICA_ASSERT(code == Z_OK);
  packed.resize(size);
  return packed;
}

std::string base64(std::string_view bytes) {
  std::string text(4 * ((bytes.size() + 2) / 3) + 1, '\0');  // the library ends it with a zero
  const int length =
      EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()), bytes_of(bytes), narrow<int>(bytes.size()));
  text.resize(narrow<std::size_t>(length));
  return text;
}

std::string sha256_base64(std::string_view bytes) {
  std::string digest(EVP_MAX_MD_SIZE, '\0');
  unsigned length = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), reinterpret_cast<unsigned char*>(digest.data()), &length, EVP_sha256(),
                 nullptr) != 1) {
    throw std::bad_alloc();  // it fails at SHA-256 only where memory ends
  }
  digest.resize(length);
  return base64(digest);
}

}  // namespace tunica

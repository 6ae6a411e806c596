#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tunica {

/// Asks for large pages around [begin, begin + bytes), which has not been written yet: the system then clears and maps
/// it in far fewer steps. A hint: nothing changes but time, and up to one large page (2 MiB) of memory at each end.
void prefer_large_pages(void* begin, std::size_t bytes);

/// How much to ask the allocator for when `bytes` are needed: a little more where that makes it map whole large pages
/// (of the address space; memory is taken where it is written).
std::size_t whole_large_pages(std::size_t bytes);

/// Writes to every page of [begin, begin + bytes), by all threads, so that the system maps them now.
/// Errors: none; the contents are undefined afterwards.
void touch_pages(void* begin, std::size_t bytes);

/// Room in an empty vector for `size` elements, where the memory is likely new to the process: in large pages, which
/// are mapped by whoever writes to them first.
template <typename T>
void reserve_fresh(std::vector<T>& vector, std::size_t size) {
  vector.reserve(whole_large_pages(size * sizeof(T)) / sizeof(T));
  prefer_large_pages(vector.data(), size * sizeof(T));
}

/// Memory that is zero without being written: for large vectors of words that begin as zeros, `std::vector<Word,
/// ZeroedAllocator<Word>>(size)`. Elements given a value are constructed as usual.
template <typename T>
class ZeroedAllocator {
public:
  using value_type = T;
  ZeroedAllocator() = default;
  template <typename U>
  explicit ZeroedAllocator(const ZeroedAllocator<U>&) {}

  [[nodiscard]] T* allocate(std::size_t size);
  void deallocate(T* memory, std::size_t) noexcept;
  template <typename U>
  void construct(U*) noexcept {}
  template <typename U, typename Arg>
  void construct(U* place, Arg&& value) {
    ::new (static_cast<void*>(place)) U(static_cast<Arg&&>(value));
  }
  friend bool operator==(const ZeroedAllocator&, const ZeroedAllocator&) { return true; }
};

extern template class ZeroedAllocator<std::uint64_t>;

}  // namespace tunica

#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>

#if !defined(TUNICA_PLAIN_SIMD) && __has_include(<experimental/simd>)
#include <experimental/simd>
#endif

/// Several numbers that go through the same arithmetic at once: std::experimental::simd (ISO/IEC TS 19570) where the
/// standard library has it, else, or where TUNICA_PLAIN_SIMD is defined, an array with that part of its interface that
/// is used here, which a compiler may or may not turn into instructions for several numbers.
namespace tunica::simd {

#if !defined(TUNICA_PLAIN_SIMD) && defined(__cpp_lib_experimental_parallel_simd)
#define TUNICA_STANDARD_SIMD

template <typename T, std::size_t N>
using Vector = std::experimental::simd<T, std::experimental::simd_abi::deduce_t<T, N>>;

using std::experimental::abs;
using std::experimental::all_of;
using std::experimental::any_of;
using std::experimental::element_aligned;
using std::experimental::max;
using std::experimental::min;
using std::experimental::none_of;
using std::experimental::reduce;
using std::experimental::sqrt;
using std::experimental::where;

#else

struct ElementAligned {};
inline constexpr ElementAligned element_aligned;

template <std::size_t N>
struct VectorMask {
  VectorMask() = default;
  explicit VectorMask(bool value) { values.fill(value); }

  bool operator[](std::size_t i) const { return values[i]; }
  bool& operator[](std::size_t i) { return values[i]; }

  friend VectorMask operator&&(const VectorMask& a, const VectorMask& b) {
    return made([&](std::size_t i) { return a[i] && b[i]; });
  }
  friend VectorMask operator||(const VectorMask& a, const VectorMask& b) {
    return made([&](std::size_t i) { return a[i] || b[i]; });
  }
  VectorMask operator!() const {
    return made([&](std::size_t i) { return !values[i]; });
  }

  template <typename Make>
  static VectorMask made(const Make& make) {
    VectorMask result;
    for (std::size_t i = 0; i < N; ++i) {
      result.values[i] = make(i);
    }
    return result;
  }

  std::array<bool, N> values{};
};

/// Of the places of a mask.
template <std::size_t N>
bool any_of(const VectorMask<N>& mask) {
  bool any = false;
  for (const bool value : mask.values) {
    any = any || value;
  }
  return any;
}

/// Of the places of a mask.
template <std::size_t N>
bool none_of(const VectorMask<N>& mask) {
  return !any_of(mask);
}

/// Of the places of a mask.
template <std::size_t N>
bool all_of(const VectorMask<N>& mask) {
  return !any_of(!mask);
}

template <typename T, std::size_t N>
class Vector {
public:
  using value_type = T;
  using mask_type = VectorMask<N>;

  Vector() = default;
  /// The same number everywhere.
  template <typename U, typename = std::enable_if_t<std::is_arithmetic_v<U>>>
  Vector(U value) {  // NOLINT: numbers mix with vectors as they do in the standard's
    values_.fill(static_cast<T>(value));
  }
  /// @param make  of the place, 0 ... N - 1
  template <typename Make, typename = std::enable_if_t<std::is_invocable_v<const Make&, std::size_t>>, typename = void>
  explicit Vector(const Make& make) {
    for (std::size_t i = 0; i < N; ++i) {
      values_[i] = static_cast<T>(make(i));
    }
  }
  Vector(const T* from, ElementAligned) { copy_from(from, {}); }

  static constexpr std::size_t size() { return N; }
  T operator[](std::size_t i) const { return values_[i]; }
  T& operator[](std::size_t i) { return values_[i]; }

  void copy_from(const T* from, ElementAligned) {
    for (std::size_t i = 0; i < N; ++i) {
      values_[i] = from[i];
    }
  }
  void copy_to(T* to, ElementAligned) const {
    for (std::size_t i = 0; i < N; ++i) {
      to[i] = values_[i];
    }
  }

  friend Vector operator+(const Vector& a, const Vector& b) {
    return Vector([&](std::size_t i) { return a[i] + b[i]; });
  }
  friend Vector operator-(const Vector& a, const Vector& b) {
    return Vector([&](std::size_t i) { return a[i] - b[i]; });
  }
  friend Vector operator*(const Vector& a, const Vector& b) {
    return Vector([&](std::size_t i) { return a[i] * b[i]; });
  }
  friend Vector operator/(const Vector& a, const Vector& b) {
    return Vector([&](std::size_t i) { return a[i] / b[i]; });
  }
  Vector operator-() const {
    return Vector([&](std::size_t i) { return -values_[i]; });
  }
  Vector& operator+=(const Vector& other) { return *this = *this + other; }
  Vector& operator-=(const Vector& other) { return *this = *this - other; }
  Vector& operator*=(const Vector& other) { return *this = *this * other; }
  Vector& operator/=(const Vector& other) { return *this = *this / other; }

  friend mask_type operator<(const Vector& a, const Vector& b) {
    return mask_type::made([&](std::size_t i) { return a[i] < b[i]; });
  }
  friend mask_type operator<=(const Vector& a, const Vector& b) {
    return mask_type::made([&](std::size_t i) { return a[i] <= b[i]; });
  }
  friend mask_type operator>(const Vector& a, const Vector& b) { return b < a; }
  friend mask_type operator>=(const Vector& a, const Vector& b) { return b <= a; }
  friend mask_type operator==(const Vector& a, const Vector& b) {
    return mask_type::made([&](std::size_t i) { return a[i] == b[i]; });
  }
  friend mask_type operator!=(const Vector& a, const Vector& b) { return !(a == b); }

private:
  std::array<T, N> values_{};
};

/// Place by place.
template <typename T, std::size_t N>
Vector<T, N> min(const Vector<T, N>& a, const Vector<T, N>& b) {
  return Vector<T, N>([&](std::size_t i) { return b[i] < a[i] ? b[i] : a[i]; });
}

/// Place by place.
template <typename T, std::size_t N>
Vector<T, N> max(const Vector<T, N>& a, const Vector<T, N>& b) {
  return Vector<T, N>([&](std::size_t i) { return a[i] < b[i] ? b[i] : a[i]; });
}

/// Place by place.
template <typename T, std::size_t N>
Vector<T, N> sqrt(const Vector<T, N>& a) {
  return Vector<T, N>([&](std::size_t i) { return std::sqrt(a[i]); });
}

/// Place by place.
template <typename T, std::size_t N>
Vector<T, N> abs(const Vector<T, N>& a) {
  return Vector<T, N>([&](std::size_t i) { return std::abs(a[i]); });
}

/// The sum.
template <typename T, std::size_t N>
T reduce(const Vector<T, N>& a) {
  T sum{};
  for (std::size_t i = 0; i < N; ++i) {
    sum += a[i];
  }
  return sum;
}

template <typename T, std::size_t N>
class WhereExpression {
public:
  WhereExpression(const VectorMask<N>& mask, Vector<T, N>& vector) : mask_(mask), vector_(vector) {}
  void operator=(const Vector<T, N>& values) {  // NOLINT: as the standard's
    for (std::size_t i = 0; i < N; ++i) {
      vector_[i] = mask_[i] ? values[i] : vector_[i];
    }
  }

private:
  const VectorMask<N>& mask_;
  Vector<T, N>& vector_;
};

/// where(mask, vector) = values: only where the mask is true.
template <typename T, std::size_t N>
WhereExpression<T, N> where(const VectorMask<N>& mask, Vector<T, N>& vector) {
  return {mask, vector};
}

#endif

}  // namespace tunica::simd

#include "tunica/io/volume/detail/volume_format.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/volume/label_names.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace tunica::volume_format {
namespace fs = std::filesystem;
namespace {

template <class T>
T byte_swapped(T value) {
  std::array<unsigned char, sizeof(T)> bytes;
  std::memcpy(bytes.data(), &value, sizeof(T));
  std::reverse(bytes.begin(), bytes.end());
  std::memcpy(&value, bytes.data(), sizeof(T));
  return value;
}

std::optional<std::uint64_t> product(std::span<const Axis> axes, bool picked_once) {
  std::uint64_t result = 1;
  for (const Axis& axis : axes) {
    const std::uint64_t factor = picked_once && axis.pick ? 1 : axis.size;
    if (__builtin_mul_overflow(result, factor, &result)) {
      return {};
    }
  }
  return result;
}

[[noreturn]] void throw_truncated(const ByteStream& stream, std::uint64_t missing, std::uint64_t total, bool at_least) {
  throw InputError(
      fmt::format("{}: truncated: {}{} of the {} bytes of voxels its header promises are missing; get the "
                  "whole file again",
                  stream.path().string(), at_least ? "at least " : "", missing, total));
}

// Where the next bytes go to.
using Room = std::span<char>;

// Copies the wanted elements of an array of `element` bytes from a stream, slab by slab; `next_room` is asked for room
// at the start and each time it is full.
class Picker {
public:
  Picker(ByteStream& stream, std::vector<Axis> axes, std::size_t element, std::uint64_t total,
         std::function<Room()> next_room)
      : stream_(stream),
        element_(element),
        total_(total),
        next_room_(std::move(next_room)),
        room_(next_room_()),
        start_(stream.position()) {
    // Neighbouring axes that are read whole are one axis.
    for (const Axis& axis : axes) {
      if (!axis.pick && !axes_.empty() && !axes_.back().pick) {
        axes_.back().size *= axis.size;
      } else if (axis.size > 1 || !axis.pick) {
        axes_.push_back(axis);
      }
    }
    slab_.push_back(element);
    for (const Axis& axis : axes_) {
      slab_.push_back(slab_.back() * axis.size);
    }
  }

  void run() { read(axes_.size()); }

private:
  void read(std::size_t axis_count) {
    if (axis_count == 0) {
      take(element_);
      return;
    }
    const Axis& axis = axes_[axis_count - 1];
    const std::uint64_t below = slab_[axis_count - 1];
    if (axis.pick) {
      drop(*axis.pick * below);
      read(axis_count - 1);
      drop((axis.size - 1 - *axis.pick) * below);
    } else if (axis_count == 1) {
      take(axis.size * below);
    } else if (axis_count == 2) {
      interleaved(axis.size, axes_[0]);
    } else {
      for (std::uint64_t i = 0; i < axis.size; ++i) {
        read(axis_count - 1);
      }
    }
  }

  // `count` tuples of tuple.size elements, one of each wanted: a buffer instead of a call per voxel.
  void interleaved(std::uint64_t count, const Axis& tuple) {
    const std::uint64_t tuple_bytes = tuple.size * element_;
    if (tuple_bytes > buffer_bytes) {
      for (std::uint64_t i = 0; i < count; ++i) {
        drop(*tuple.pick * element_);
        take(element_);
        drop((tuple.size - 1 - *tuple.pick) * element_);
      }
      return;
    }
    const std::uint64_t at_once = buffer_bytes / tuple_bytes;
    std::vector<char> buffer(at_once * tuple_bytes);
    for (std::uint64_t done = 0; done < count;) {
      check_interrupt();
      const std::uint64_t now = std::min({at_once, count - done, room_.size() / element_});
      require(stream_.read(buffer.data(), now * tuple_bytes), now * tuple_bytes);
      const char* from = buffer.data() + *tuple.pick * element_;
      for (std::uint64_t i = 0; i < now; ++i, from += tuple_bytes) {
        std::memcpy(room_.data() + i * element_, from, element_);
      }
      advance_by(now * element_);
      done += now;
    }
  }

  void take(std::uint64_t bytes) {
    while (bytes > 0) {
      check_interrupt();
      const std::size_t now = std::min<std::uint64_t>({bytes, std::size_t{1} << 24, room_.size()});
      require(stream_.read(room_.data(), now), now);
      advance_by(now);
      bytes -= now;
    }
  }

  void advance_by(std::size_t bytes) {
    room_ = room_.subspan(bytes);
    if (room_.empty()) {
      room_ = next_room_();
    }
  }

  void drop(std::uint64_t bytes) { require(stream_.skip(bytes), bytes); }

  void require(std::uint64_t got, std::uint64_t wanted) const {
    if (got < wanted) {
      throw_truncated(stream_, total_ - (stream_.position() - start_), total_, false);
    }
  }

  ByteStream& stream_;
  std::vector<Axis> axes_;
  std::vector<std::uint64_t> slab_;  // bytes of one step along each axis, and of the whole
  std::size_t element_;
  std::uint64_t total_;
  std::function<Room()> next_room_;
  Room room_;
  std::uint64_t start_;
};

struct Plan {
  std::uint64_t count;  // voxels wanted
  std::uint64_t total;  // elements stored
};

Plan plan(const ByteStream& stream, const std::vector<Axis>& axes, std::size_t bytes_each) {
  const auto count = product(axes, true);
  const auto total = product(axes, false);
  std::uint64_t bytes = 0;
  if (!count || !total || __builtin_mul_overflow(*total, bytes_each, &bytes)) {
    throw InputError(
        fmt::format("{}: its sizes multiply to more than 2^64 bytes: the header is corrupt", stream.path().string()));
  }
  const std::uint64_t left = stream.most_bytes() - std::min(stream.most_bytes(), stream.position());
  if (bytes > left) {
    throw_truncated(stream, bytes - left, bytes, true);
  }
  return {*count, *total};
}

// The slab that is being filled, given to the sink when it is full.
template <class T>
class Slab {
public:
  Slab(const VolumeFile& file, VoxelType type, const SlabSink& sink)
      : file_(file), sink_(sink), slices_(sink.slices(file.volume.dims, type)) {
    volume_.dims = file.volume.dims;
    volume_.affine = file.volume.affine;
    volume_.slope = file.volume.slope;
    volume_.intercept = file.volume.intercept;
  }

  // The empty next slab, none after the last one.
  std::vector<T>& next() {
    volume_.dims[2] = std::min(slices_, file_.volume.dims[2] - first_);
    auto& values = volume_.data.emplace<std::vector<T>>(std::move(values_));
    values.resize(volume_.voxels());
    return values;
  }

  void give() {
    sink_.visit(file_, volume_, first_);
    first_ += volume_.dims[2];
    values_ = std::move(std::get<std::vector<T>>(volume_.data));
  }

private:
  const VolumeFile& file_;
  const SlabSink& sink_;
  std::size_t slices_;
  Volume volume_;
  std::vector<T> values_;
  std::size_t first_ = 0;
};

template <class T>
void to_native(std::vector<T>& values, bool big_endian) {
  if constexpr (sizeof(T) > 1) {
    if (big_endian != (std::endian::native == std::endian::big)) {
      for (T& value : values) {
        value = byte_swapped(value);
      }
    }
  }
}

template <class T>
void read_typed(VolumeFile& file, ByteStream& stream, VoxelType type, bool big_endian, const std::vector<Axis>& axes,
                const Plan& sizes, const SlabSink* sink) {
  const auto room = [](std::vector<T>& values) {
    return Room(reinterpret_cast<char*>(values.data()), values.size() * sizeof(T));
  };
  const std::uint64_t bytes = sizes.total * sizeof(T);
  if (sink == nullptr) {
    std::vector<T> values(sizes.count);
    bool given = false;
    Picker(stream, axes, sizeof(T), bytes, [&] { return std::exchange(given, true) ? Room{} : room(values); }).run();
    to_native(values, big_endian);
    file.volume.data = std::move(values);
    return;
  }
  Slab<T> slab(file, type, *sink);
  std::vector<T>* filling = nullptr;
  Picker(stream, axes, sizeof(T), bytes, [&] {
    if (filling != nullptr) {
      to_native(*filling, big_endian);
      slab.give();
    }
    filling = &slab.next();
    return room(*filling);
  }).run();
}

// Words of a text stream, separated by white space or commas.
class TextValues {
public:
  explicit TextValues(ByteStream& stream) : stream_(stream), buffer_(buffer_bytes) {}

  bool next(std::string& word) {
    word.clear();
    for (;;) {
      if (at_ == end_) {
        check_interrupt();
        end_ = stream_.read(buffer_.data(), buffer_.size());
        at_ = 0;
        if (end_ == 0) {
          return !word.empty();
        }
      }
      const char c = buffer_[at_++];
      const bool separator = c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == ',';
      if (!separator) {
        word += c;
      } else if (!word.empty()) {
        return true;
      }
      if (word.size() > 400) {
        return true;  // no number is that long: parse() refuses it
      }
    }
  }

private:
  ByteStream& stream_;
  std::vector<char> buffer_;
  std::size_t at_ = 0;
  std::size_t end_ = 0;
};

template <class T>
void read_text(VolumeFile& file, ByteStream& stream, VoxelType type, const std::vector<Axis>& axes, const Plan& sizes,
               const SlabSink* sink) {
  std::vector<T> whole(sink == nullptr ? sizes.count : 0);
  std::optional<Slab<T>> slab;
  if (sink != nullptr) {
    slab.emplace(file, type, *sink);
  }
  std::vector<T>* values = slab ? &slab->next() : &whole;
  std::size_t filled = 0;
  TextValues text(stream);
  std::string word;
  for (std::uint64_t n = 0; n < sizes.total; ++n) {
    if (!text.next(word)) {
      throw InputError(
          fmt::format("{}: truncated: {} of the {} numbers its header promises are missing; get the whole "
                      "file again",
                      stream.path().string(), sizes.total - n, sizes.total));
    }
    bool wanted = true;
    std::uint64_t index = n;
    for (const Axis& axis : axes) {
      wanted = wanted && (!axis.pick || index % axis.size == *axis.pick);
      index /= axis.size;
    }
    if (!wanted) {
      continue;
    }
    T value{};
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size()) {
      throw InputError(fmt::format("{}: voxel {} is '{}', which is no number of the type the header names",
                                   stream.path().string(), n, shown(word.substr(0, 40))));
    }
    (*values)[filled++] = value;
    if (slab && filled == values->size()) {
      slab->give();
      values = &slab->next();
      filled = 0;
    }
  }
  if (!slab) {
    file.volume.data = std::move(whole);
  }
}

template <class Function>
auto with_type(VoxelType type, Function function) {
  switch (type) {
    case VoxelType::uint8:
      return function(std::uint8_t{});
    case VoxelType::int8:
      return function(std::int8_t{});
    case VoxelType::uint16:
      return function(std::uint16_t{});
    case VoxelType::int16:
      return function(std::int16_t{});
    case VoxelType::uint32:
      return function(std::uint32_t{});
    case VoxelType::int32:
      return function(std::int32_t{});
    case VoxelType::uint64:
      return function(std::uint64_t{});
    case VoxelType::int64:
      return function(std::int64_t{});
    case VoxelType::float32:
      return function(float{});
    case VoxelType::float64:
      return function(double{});
  }
  throw InternalError("voxel type");
}

}  // namespace

std::size_t size_of(VoxelType type) {
  constexpr std::array<std::size_t, 10> sizes{1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  return sizes.at(static_cast<std::size_t>(type));
}

std::string name_of(VoxelType type) {
  constexpr std::array<const char*, 10> names{"uint8", "int8",   "uint16", "int16",   "uint32",
                                              "int32", "uint64", "int64",  "float32", "float64"};
  return names.at(static_cast<std::size_t>(type));
}

Volume::Data make_voxels(VoxelType type, std::size_t count) {
  return with_type(type, [&](auto zero) { return Volume::Data(std::vector<decltype(zero)>(count)); });
}

std::size_t SlabSink::slices(const std::array<std::size_t, 3>& dims, VoxelType type) const {
  const std::uint64_t slice = narrow<std::uint64_t>(dims[0]) * dims[1] * size_of(type);
  return std::clamp<std::uint64_t>(std::min<std::uint64_t>(size.bytes / slice, size.slices.value_or(dims[2])), 1,
                                   dims[2]);
}

std::uint64_t stored_bytes(const std::vector<Axis>& axes, VoxelType type) {
  std::uint64_t bytes = size_of(type);
  for (const Axis& axis : axes) {
    if (__builtin_mul_overflow(bytes, axis.size, &bytes)) {
      return std::numeric_limits<std::uint64_t>::max();
    }
  }
  return bytes;
}

void read_voxels(VolumeFile& file, ByteStream& stream, VoxelType type, bool big_endian, const std::vector<Axis>& axes,
                 const SlabSink* sink, bool more) {
  const Plan sizes = plan(stream, axes, size_of(type));
  if (sink != nullptr && !sink->visit) {
    return;
  }
  with_type(type, [&](auto zero) { read_typed<decltype(zero)>(file, stream, type, big_endian, axes, sizes, sink); });
  std::vector<Warning> more_bytes;
  stream.finish(more ? more_bytes : file.warnings);
}

void read_text_voxels(VolumeFile& file, ByteStream& stream, VoxelType type, const std::vector<Axis>& axes,
                      const SlabSink* sink) {
  // A number and what separates it from the next are two bytes at the least, but for the last.
  const Plan sizes = plan(stream, axes, 1);
  if (sizes.total / 2 > stream.most_bytes()) {
    throw_truncated(stream, sizes.total - stream.most_bytes() / 2, sizes.total, true);
  }
  if (sink != nullptr && !sink->visit) {
    return;
  }
  with_type(type, [&](auto zero) { read_text<decltype(zero)>(file, stream, type, axes, sizes, sink); });
  stream.finish(file.warnings);
}

std::size_t choose(const fs::path& path, const char* what, std::uint64_t count, std::optional<std::size_t> chosen,
                   const std::string& hint) {
  if (!chosen) {
    if (count > 1) {
      throw InputError(fmt::format("{}: has {} {}s: choose one with --{} 0..{}{}", path.string(), count, what, what,
                                   count - 1, hint));
    }
    return 0;
  }
  if (*chosen >= count) {
    throw InputError(fmt::format("{}: has {} {}{}, so --{} {} does not exist: choose one of 0..{}{}", path.string(),
                                 count, what, count == 1 ? "" : "s", what, *chosen, count - 1, hint));
  }
  return *chosen;
}

std::size_t leading_channels(std::span<const std::uint64_t> sizes) {
  std::size_t channels = 0;
  while (channels < sizes.size() && sizes[channels] == 1) {
    ++channels;
  }
  std::size_t end = sizes.size();
  while (end > channels && sizes[end - 1] == 1) {
    --end;
  }
  const bool long_ones =
      std::none_of(sizes.begin() + channels, sizes.begin() + end, [](auto size) { return size == 1; });
  return end == channels + 3 && long_ones ? channels : 0;
}

Warning channel_note(const fs::path& path, std::span<const std::uint64_t> sizes) {
  return {Weight::note, "channel first",
          fmt::format("{}: its sizes are {}: the leading 1 is taken as a channel, the other three axes as space, with "
                      "the spacing and orientation of the header; pass --frame N if the last axis is time",
                      path.string(), fmt::join(sizes, " x "))};
}

std::size_t choose_frame(VolumeFile& file, const fs::path& path, std::span<const std::uint64_t> sizes,
                         std::optional<std::size_t> chosen) {
  file.frames = sizes.size() > 3 ? sizes[3] : 1;
  // A scan's first axis is a row of pixels, of which there are no fewer than slices or frames.
  if (file.frames == 1 || sizes[0] == 1 || *std::min_element(sizes.begin() + 1, sizes.begin() + 4) <= sizes[0]) {
    return choose(path, "frame", file.frames, chosen);
  }
  const std::string looks =
      fmt::format("{}: its sizes are {}: its first axis looks like {} channels, one for each class", path.string(),
                  fmt::join(sizes.first(4), " x "), sizes[0]);
  if (!chosen) {
    throw InputError(
        fmt::format("{}, before three axes of space: save the classes as one volume of labels (argmax over the first "
                    "axis); or pass --frame 0..{} if it is a series of {} volumes that are {} voxels wide",
                    looks, file.frames - 1, file.frames, sizes[0]));
  }
  const std::size_t frame = choose(path, "frame", file.frames, chosen);
  file.warnings.push_back({Weight::major, "channel first",
                           fmt::format("{}, and --frame {} takes a sheet of {} voxels across them: leave it out unless "
                                       "it is a series of volumes as thin as that",
                                       looks, frame, sizes[0])});
  return frame;
}

std::optional<std::string> affine_error(const Eigen::Matrix<double, 3, 4>& affine) {
  constexpr double largest = 1e9;  // mm
  // Of the product of a voxel's edges, its volume: below it, an axis lies within .6 degrees of the plane of the others,
  // and voxels are slivers. A gantry tilted by 30 degrees leaves .87.
  constexpr double least_volume = 0.01;
  if (!affine.allFinite()) {
    return "is not finite";
  }
  if (affine.cwiseAbs().maxCoeff() > largest) {
    return fmt::format("reaches {:.3g} mm", affine.cwiseAbs().maxCoeff());
  }
  const Mat3 axes = affine.leftCols<3>();
  const Vec3 spacing = axes.colwise().norm().transpose();
  if (axes.isZero(0)) {
    return "is all zero";
  }
  if (!(spacing.minCoeff() > 1e-9) || !(std::abs(axes.determinant()) >= least_volume * spacing.prod())) {
    return fmt::format("is singular or nearly so (voxels of {:.6g} x {:.6g} x {:.6g} mm with a volume of {:.6g} mm3)",
                       spacing.x(), spacing.y(), spacing.z(), std::abs(axes.determinant()));
  }
  return {};
}

void set_affine(VolumeFile& file, const fs::path& path, const Eigen::Matrix<double, 3, 4>& lps) {
  if (const auto why = affine_error(lps)) {
    throw InputError(fmt::format("{}: its {} {}: voxels have no place or no volume; correct the header", path.string(),
                                 file.transform, *why));
  }
  const Mat3 axes = lps.leftCols<3>();
  file.spacing = axes.colwise().norm().transpose();
  file.volume.affine = lps;

  // Each index axis gets the world axis it follows most, no world axis twice.
  constexpr std::array<const char*, 3> letters{"RL", "AP", "IS"};  // towards -, towards + of LPS
  file.orientation = "???";
  std::array<bool, 3> column_done{};
  std::array<bool, 3> row_done{};
  for (int step = 0; step < 3; ++step) {
    int best_row = -1;
    int best_column = -1;
    double best = -1;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        const double cosine = std::abs(axes(row, column)) / file.spacing[column];
        if (!row_done[row] && !column_done[column] && cosine > best) {
          best = cosine;
          best_row = row;
          best_column = column;
        }
      }
    }
    row_done[best_row] = true;
    column_done[best_column] = true;
    file.orientation[best_column] = letters[best_row][axes(best_row, best_column) > 0 ? 1 : 0];
  }
}

Eigen::Matrix<double, 3, 4> flip_xy(Eigen::Matrix<double, 3, 4> affine) {
  affine.topRows<2>() = -affine.topRows<2>();
  return affine;
}

void warn_of_several_names(VolumeFile& file, const fs::path& path) {
  if (auto warning = several_names(path, file.volume.label_names)) {
    file.warnings.push_back(std::move(*warning));
  }
}

void set_dims(VolumeFile& file, const fs::path& path, std::span<const std::uint64_t, 3> dims) {
  std::uint64_t count = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (dims[axis] == 0 || __builtin_mul_overflow(count, dims[axis], &count) ||
        count > std::numeric_limits<std::uint64_t>::max() / 16) {
      throw InputError(fmt::format("{}: a volume of {} x {} x {} voxels is impossible: the header is corrupt",
                                   path.string(), dims[0], dims[1], dims[2]));
    }
    file.volume.dims[axis] = dims[axis];
  }
}

fs::path data_file_beside(const fs::path& header, const std::string& name) {
  const fs::path relative(name);
  const bool plain = shown(name) == name && !name.empty() && relative.is_relative() &&
                     std::none_of(relative.begin(), relative.end(), [](const fs::path& part) { return part == ".."; });
  if (!plain) {
    throw InputError(
        fmt::format("{}: its data file '{}' is not in the header's own folder: move it there and name it "
                    "by its file name alone",
                    header.string(), shown(name)));
  }
  const fs::path path = header.parent_path() / relative;
  std::error_code error;
  if (!fs::exists(path, error)) {
    throw InputError(
        fmt::format("{}: its data file {} is missing: put it beside the header", header.string(), path.string()));
  }
  return path;
}

std::string shown(std::string_view text) {
  std::string result(text.substr(0, 200));
  std::replace_if(
      result.begin(), result.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return text.size() > result.size() ? result + "..." : result;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view space = " \t\r\n\v\f";
  const auto first = text.find_first_not_of(space);
  return first == std::string_view::npos ? std::string_view()
                                         : text.substr(first, text.find_last_not_of(space) - first + 1);
}

std::vector<std::string_view> words(std::string_view text) {
  constexpr std::string_view space = " \t\r\n\v\f";
  std::vector<std::string_view> result;
  for (auto at = text.find_first_not_of(space); at != std::string_view::npos; at = text.find_first_not_of(space, at)) {
    const auto end = std::min(text.find_first_of(space, at), text.size());
    result.push_back(text.substr(at, end - at));
    at = end;
  }
  return result;
}

std::string lower_case(std::string_view text) {
  std::string result(text);
  for (char& c : result) {
    c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return result;
}

std::optional<std::uint64_t> parse_count(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    return {};
  }
  return value;
}

}  // namespace tunica::volume_format

#include "core/error.hpp"
#include "core/progress.hpp"
#include "io/slice_header.hpp"
#include "io/volume_format.hpp"

#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <iostream>

namespace tunica::volume_format {
namespace fs = std::filesystem;
namespace {

VoxelType voxel_type(const SliceHeader& header) {
  using Kind = SliceHeader::Kind;
  switch (header.bits) {
    case 8:
      return header.kind == Kind::integer ? VoxelType::int8 : VoxelType::uint8;
    case 16:
      return header.kind == Kind::integer ? VoxelType::int16 : VoxelType::uint16;
    case 32:
      return header.kind == Kind::real ? VoxelType::float32 : VoxelType::int32;
    default:
      return VoxelType::float64;
  }
}

// "slice10" after "slice9": runs of digits compare as numbers.
bool natural_less(const std::string& a, const std::string& b) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() && j < b.size()) {
    if (!digit(a[i]) || !digit(b[j])) {
      if (a[i] != b[j]) {
        return a[i] < b[j];
      }
      ++i;
      ++j;
      continue;
    }
    const auto run = [&](const std::string& text, std::size_t& at) {
      while (at < text.size() && text[at] == '0') {
        ++at;
      }
      const std::size_t begin = at;
      while (at < text.size() && digit(text[at])) {
        ++at;
      }
      return text.substr(begin, at - begin);
    };
    const std::string x = run(a, i);
    const std::string y = run(b, j);
    if (x != y) {
      return x.size() != y.size() ? x.size() < y.size() : x < y;
    }
  }
  return a.size() - i != b.size() - j ? a.size() - i < b.size() - j : a < b;
}

// The number a slice's name ends in, and what stands before it.
std::optional<std::pair<std::string, std::uint64_t>> numbered(const fs::path& path) {
  const std::string stem = path.stem().string();
  const std::size_t last = stem.find_last_not_of("0123456789");
  const std::size_t begin = last == std::string::npos ? 0 : last + 1;
  const auto value = parse_count(std::string_view(stem).substr(begin));
  return value ? std::optional(std::pair(stem.substr(0, begin), *value)) : std::nullopt;
}

void warn_of_gaps(const fs::path& folder, const std::vector<fs::path>& slices, std::vector<std::string>& warnings) {
  std::vector<std::uint64_t> steps;
  for (std::size_t i = 1; i < slices.size(); ++i) {
    const auto before = numbered(slices[i - 1]);
    const auto after = numbered(slices[i]);
    if (!before || !after || before->first != after->first || after->second <= before->second) {
      return;
    }
    steps.push_back(after->second - before->second);
  }
  const auto largest = std::max_element(steps.begin(), steps.end());
  if (largest != steps.end() && *largest > *std::min_element(steps.begin(), steps.end())) {
    const auto before = static_cast<std::size_t>(largest - steps.begin());
    warnings.push_back(fmt::format("{}: a slice seems to be missing between {} and {}", folder.string(),
                                   slices[before].filename().string(), slices[before + 1].filename().string()));
  }
}

// The slices of a folder in the natural order of their names.
std::vector<fs::path> slices_in(const fs::path& folder, std::vector<std::string>& warnings) {
  std::vector<fs::path> slices;
  std::size_t others = 0;
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  if (error) {
    throw InputError(fmt::format("{}: the folder cannot be read: {}", folder.string(), error.message()));
  }
  for (const fs::directory_entry& entry : entries) {
    const std::string extension = lower_case(entry.path().extension().string());
    const bool hidden = entry.path().filename().string().starts_with('.');
    if (!hidden && (extension == ".png" || extension == ".tif" || extension == ".tiff")) {
      slices.push_back(entry.path());
    } else {
      others += hidden ? 0 : 1;
    }
  }
  if (slices.empty()) {
    throw InputError(fmt::format("{}: the folder holds no .png, .tif or .tiff slices{}", folder.string(),
                                 others > 0 ? " (a DICOM series has to be converted to NIfTI first)" : ""));
  }
  std::sort(slices.begin(), slices.end(), [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  });
  if (others > 0) {
    warnings.push_back(
        fmt::format("{}: {} files that are no slices (.png, .tif, .tiff) are ignored", folder.string(), others));
  }
  warn_of_gaps(folder, slices, warnings);
  return slices;
}

std::string content_head(const fs::path& path) {
  ByteStream stream(path, 0, Coding::plain);
  std::string head(16, '\0');
  head.resize(stream.read(head.data(), head.size()));
  return head;
}

std::vector<SliceHeader> headers_of(const fs::path& path, bool& png) {
  const std::string head = content_head(path);
  if (head.empty()) {
    throw InputError(fmt::format("{}: is empty", path.string()));
  }
  if (looks_like_tiff(head)) {
    return read_tiff_headers(path);
  }
  png = looks_like_png(head);
  if (png) {
    return {read_png_header(path)};
  }
  throw InputError(fmt::format("{}: is neither TIFF nor PNG, whatever its name says", path.string()));
}

[[noreturn]] void throw_undecodable(const fs::path& path, std::size_t page) {
  throw InputError(fmt::format("{}: the pixels of page {} cannot be decoded: the file is corrupt; get it again",
                               path.string(), page));
}

// While it lives OpenCV says nothing: its messages would come as a second line of error.
class Silence {
public:
  Silence()
      : level_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)),
        stream_(std::cerr.rdbuf(nullptr)) {
    cv::redirectError([](int, const char*, const char*, const char*, int, void*) { return 0; });
  }
  ~Silence() {
    cv::redirectError(nullptr);
    std::cerr.rdbuf(stream_);
    cv::utils::logging::setLogLevel(level_);
  }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;

private:
  cv::utils::logging::LogLevel level_;
  std::streambuf* stream_;
};

std::vector<cv::Mat> decode(const fs::path& path, bool png, std::size_t first, std::size_t count) {
  const Silence silence;
  std::vector<cv::Mat> pages;
  try {
    if (png) {
      pages.push_back(cv::imdecode(read_png_pixels(path), cv::IMREAD_UNCHANGED));
    } else {
      cv::imreadmulti(path.string(), pages, static_cast<int>(first), static_cast<int>(count), cv::IMREAD_UNCHANGED);
    }
  } catch (const cv::Exception&) {
    throw_undecodable(path, first + pages.size());
  }
  return pages;
}

// Copies decoded pages to where they belong; `to` advances by their bytes.
void store(const fs::path& path, std::size_t first, const std::vector<cv::Mat>& pages, std::size_t wanted,
           const SliceHeader& header, char*& to) {
  if (pages.size() < wanted) {
    throw_undecodable(path, first + pages.size());
  }
  for (std::size_t i = 0; i < wanted; ++i) {
    const cv::Mat& page = pages[i];
    const bool real = page.depth() == CV_32F || page.depth() == CV_64F;
    if (page.empty() || page.channels() != 1 || page.cols != static_cast<int>(header.width) ||
        page.rows != static_cast<int>(header.height) || page.elemSize() * 8 != header.bits ||
        real != (header.kind == SliceHeader::Kind::real)) {
      throw_undecodable(path, first + i);
    }
    const std::size_t row_bytes = header.width * (header.bits / 8);
    for (int row = 0; row < page.rows; ++row, to += row_bytes) {
      std::memcpy(to, page.ptr(row), row_bytes);
    }
  }
}

struct Slice {
  fs::path path;
  bool png;
  std::size_t pages;
};

}  // namespace

VolumeFile read_slices(const fs::path& path, const VolumeOptions& options, const SlabSink* sink) {
  VolumeFile file;
  const bool folder = fs::is_directory(path);
  std::vector<fs::path> paths{path};
  if (folder) {
    paths = slices_in(path, file.warnings);
    file.data_files = paths;
  }
  if (!options.spacing) {
    throw UsageError(
        fmt::format("{}: a slice stack does not say how large its voxels are: pass --spacing X,Y,Z in mm, "
                    "for example --spacing 0.5,0.5,1.25",
                    path.string()));
  }
  choose(path, "layer", 1, options.layer);
  choose(path, "frame", 1, options.frame);

  std::vector<Slice> slices;
  std::optional<SliceHeader> common;
  std::size_t count = 0;
  for (const fs::path& slice : paths) {
    bool png = false;
    const std::vector<SliceHeader> headers = headers_of(slice, png);
    if (folder && headers.size() > 1) {
      throw InputError(fmt::format("{}: has {} pages: name this file itself, or keep one page per file in the folder",
                                   slice.string(), headers.size()));
    }
    for (std::size_t page = 0; page < headers.size(); ++page) {
      const SliceHeader& header = headers[page];
      common = common.value_or(header);
      if (header != *common) {
        throw InputError(
            fmt::format("{}: page {} has {} x {} pixels of type {}, the first slice {} x {} of type {}: all "
                        "slices of a stack must be alike",
                        slice.string(), page, header.width, header.height, name_of(voxel_type(header)), common->width,
                        common->height, name_of(voxel_type(*common))));
      }
    }
    slices.push_back({slice, png, headers.size()});
    count += headers.size();
  }
  if (count == 1) {
    file.warnings.push_back(
        fmt::format("{}: is a single slice, a volume one voxel thick: name a multi-page TIFF or the "
                    "folder of the slices",
                    path.string()));
  }
  file.format = slices.front().png ? "PNG stack" : "TIFF stack";
  const VoxelType type = voxel_type(*common);
  file.datatype = name_of(type);
  set_dims(file, path, std::array<std::uint64_t, 3>{common->width, common->height, count});
  file.transform = "--spacing";
  Eigen::Matrix<double, 3, 4> affine = Eigen::Matrix<double, 3, 4>::Zero();
  affine.leftCols<3>() = options.spacing->asDiagonal();
  set_affine(file, path, affine);

  if (sink != nullptr && !sink->visit) {
    return file;
  }
  constexpr std::size_t pages_at_once = 16;
  const auto bytes_of = [](Volume& volume) {
    return std::visit([](auto& values) { return reinterpret_cast<char*>(values.data()); }, volume.data);
  };
  char* to = nullptr;
  if (sink == nullptr) {
    file.volume.data = make_voxels(type, file.volume.voxels());
    to = bytes_of(file.volume);
  }
  std::size_t done = 0;
  for (const Slice& slice : slices) {
    for (std::size_t first = 0; first < slice.pages; first += pages_at_once) {
      check_interrupt();
      const std::size_t now = std::min(pages_at_once, slice.pages - first);
      const std::vector<cv::Mat> pages = decode(slice.path, slice.png, first, now);
      if (sink == nullptr) {
        store(slice.path, first, pages, now, *common, to);
        continue;
      }
      Volume slab = file.volume;
      slab.dims[2] = now;
      slab.data = make_voxels(type, slab.voxels());
      char* slab_bytes = bytes_of(slab);
      store(slice.path, first, pages, now, *common, slab_bytes);
      sink->visit(file, slab, done);
      done += now;
    }
  }
  return file;
}

}  // namespace tunica::volume_format

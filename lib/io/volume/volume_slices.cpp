#include "tunica/core/error.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/volume/detail/slice_file.hpp"
#include "tunica/io/volume/detail/volume_format.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>

namespace tunica::volume_format {
namespace fs = std::filesystem;
namespace {

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

// Errors: InputError: two slices of one number, such as 3 and 003.
void require_one_each(const fs::path& folder, const std::vector<fs::path>& slices) {
  for (std::size_t i = 1; i < slices.size(); ++i) {
    const auto before = numbered(slices[i - 1]);
    if (before && before == numbered(slices[i])) {
      throw InputError(fmt::format("{}: {} and {} have one number: leave one of them in the folder", folder.string(),
                                   slices[i - 1].filename().string(), slices[i].filename().string()));
    }
  }
}

void warn_of_gaps(const fs::path& folder, const std::vector<fs::path>& slices, std::vector<Warning>& warnings) {
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
    const std::size_t before = largest - steps.begin();
    warnings.push_back(
        {Weight::major, "missing slice",
         fmt::format("{}: a slice seems to be missing between {} and {}: what lies beyond is moved up by as much; "
                     "add it",
                     folder.string(), slices[before].filename().string(), slices[before + 1].filename().string())});
  }
}

// What a name looks like, its numbers aside: "slice#" for slice007.
std::string pattern_of(const fs::path& slice) {
  std::string pattern;
  for (const char sign : slice.stem().string()) {
    const bool is_digit = sign >= '0' && sign <= '9';
    if (!is_digit) {
      pattern += sign;
    } else if (!pattern.ends_with('#')) {
      pattern += '#';
    }
  }
  return pattern;
}

std::string without_signs(std::string pattern) {
  std::erase_if(pattern, [](char sign) { return sign == '-' || sign == '+'; });
  return pattern;
}

// Names that differ in more than their numbers are of several series. Errors: InputError: something stands beside a
// series, which would be taken for slices of it, or numbers have signs, and no order that is certain.
void require_one_series(const fs::path& folder, const std::vector<fs::path>& slices) {
  std::map<std::string, std::vector<std::string>> series;
  for (const fs::path& slice : slices) {
    series[pattern_of(slice)].push_back(slice.filename().string());
  }
  const auto longest = std::ranges::max_element(series, {}, [](const auto& one) { return one.second.size(); });
  if (series.size() < 2 || longest->second.size() < 2) {
    return;
  }
  const auto other = longest == series.begin() ? std::next(series.begin()) : series.begin();
  const bool are_signed = std::ranges::all_of(
      series, [&](const auto& one) { return without_signs(one.first) == without_signs(longest->first); });
  throw InputError(fmt::format(
      "{}: {}, {} like {}, {} like {}: {}", folder.string(),
      are_signed ? "its slices have numbers with and without a sign in their names, so that their order is not certain"
                 : fmt::format("its slices are of {} series, as their names say", series.size()),
      longest->second.size(), longest->second.front(), other->second.size(), other->second.front(),
      are_signed ? "number them from 0 on"
                 : "leave one series in the folder, and call its slices alike but for a number"));
}

// The slices of a folder in the natural order of their names.
std::vector<fs::path> slices_in(const fs::path& folder, std::vector<Warning>& warnings) {
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
        {Weight::note, "files ignored",
         fmt::format("{}: {} files that are no slices (.png, .tif, .tiff) are ignored", folder.string(), others)});
  }
  require_one_series(folder, slices);
  require_one_each(folder, slices);
  warn_of_gaps(folder, slices, warnings);
  return slices;
}

struct Stack {
  std::string format;
  SliceHeader common;
  std::size_t count = 0;  // slices
};

// Looks at the header of every slice.
Stack stack_of(const std::vector<fs::path>& paths, bool one_page_each) {
  Stack stack;
  std::optional<SliceHeader> common;
  for (const fs::path& path : paths) {
    const std::unique_ptr<SliceFile> slices = open_slices(path);
    stack.format = stack.format.empty() ? slices->format() : stack.format;
    std::size_t page = 0;
    for (auto header = slices->next(); header; header = slices->next(), ++page, ++stack.count) {
      common = common.value_or(*header);
      if (*header != *common) {
        throw InputError(
            fmt::format("{}: page {} has {} x {} pixels of type {}, the first slice {} x {} of type {}: all "
                        "slices of a stack must be alike",
                        path.string(), page, header->width, header->height, name_of(header->type), common->width,
                        common->height, name_of(common->type)));
      }
    }
    if (one_page_each && page > 1) {
      throw InputError(fmt::format("{}: has {} pages: name this file itself, or keep one page per file in the folder",
                                   path.string(), page));
    }
  }
  stack.common = *common;
  return stack;
}

// Decodes all pages: into the file's volume, or with a sink into that.
void read_pages(VolumeFile& file, const std::vector<fs::path>& paths, const SliceHeader& common, const SlabSink* sink) {
  const std::size_t count = file.volume.dims[2];
  const std::size_t at_once = sink == nullptr ? count : sink->slices(file.volume.dims, common.type);
  Volume slab = file.volume;
  std::size_t first = 0;   // slice of the slab
  std::size_t filled = 0;  // slices of the slab
  const auto require_unchanged = [](bool unchanged, const fs::path& path) {
    if (!unchanged) {
      throw InputError(fmt::format("{}: was changed while it was read: run this again", path.string()));
    }
  };
  for (const fs::path& path : paths) {
    const std::unique_ptr<SliceFile> slices = open_slices(path);
    for (auto header = slices->next(); header; header = slices->next()) {
      require_unchanged(first < count && *header == common, path);
      if (filled == 0) {
        slab.dims[2] = std::min(at_once, count - first);
        slab.data = make_voxels(common.type, slab.voxels());
      }
      char* const bytes = std::visit([](auto& values) { return reinterpret_cast<char*>(values.data()); }, slab.data);
      slices->decode(bytes + filled * common.row_bytes() * common.height);
      if (++filled < slab.dims[2]) {
        continue;
      }
      if (sink != nullptr) {
        sink->visit(file, slab, first);
      } else {
        file.volume.data = std::move(slab.data);
      }
      first += filled;
      filled = 0;
    }
  }
  require_unchanged(first == count, paths.back());
}

}  // namespace

std::unique_ptr<SliceFile> open_slices(const fs::path& path) {
  std::string head(16, '\0');
  head.resize(ByteStream(path, 0, Coding::plain).read(head.data(), head.size()));
  if (looks_like_tiff(head)) {
    return open_tiff(path);
  }
  if (looks_like_png(head)) {
    return open_png(path);
  }
  throw InputError(fmt::format("{}: {}", path.string(),
                               head.empty() ? "is empty" : "is neither TIFF nor PNG, whatever its name says"));
}

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
                    "for example --spacing 0.5,0.5,1.25 (of the pipeline EXTRACT='--spacing 0.5,0.5,1.25')",
                    path.string()));
  }
  choose(path, "layer", 1, options.layer);
  choose(path, "frame", 1, options.frame);

  const Stack stack = stack_of(paths, folder);
  const SliceHeader& common = stack.common;
  file.format = stack.format + " stack";
  set_type(file, common.type);
  set_dims(file, path, std::array<std::uint64_t, 3>{common.width, common.height, stack.count});
  file.transform = "--spacing";
  Eigen::Matrix<double, 3, 4> affine = Eigen::Matrix<double, 3, 4>::Zero();
  affine.leftCols<3>() = options.spacing->asDiagonal();
  set_affine(file, path, affine);

  if (sink == nullptr || sink->visit) {
    read_pages(file, paths, common, sink);
  }
  return file;
}

}  // namespace tunica::volume_format

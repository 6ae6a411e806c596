#include "tunica/io/result/run_journal.hpp"

#include "tunica/core/clock.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/version.hpp"
#include "tunica/io/file/output_file.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string_view>
#include <type_traits>

namespace tunica {
namespace fs = std::filesystem;
namespace {

constexpr std::string_view states_magic = "TUNICA STATES 2\n";
constexpr std::string_view checkpoint_magic = "TUNICA CHECKPOINT 10\n";
/// Time between checkpoints, as a multiple of what the last one took.
constexpr int spacing = 20;
constexpr std::uint64_t largest_record = std::uint64_t{1} << 40;

struct Damaged {};

// Numbers are stored as they stand in memory: a run goes on where it was interrupted.
class Packer {
public:
  template <typename T>
  void operator()(const T& value) {
    if constexpr (std::is_arithmetic_v<T>) {
      raw(&value, sizeof value);
    } else if constexpr (std::is_same_v<T, std::string>) {
      list(value.data(), value.size());
    } else {
      put(value);
    }
  }

  [[nodiscard]] const std::string& bytes() const { return bytes_; }

private:
  void raw(const void* data, std::size_t size) { bytes_.append(static_cast<const char*>(data), size); }
  template <typename T>
  void list(const T* data, std::size_t count) {
    (*this)(narrow<std::uint64_t>(count));
    raw(data, count * sizeof(T));
  }
  void put(const std::vector<double>& values) { list(values.data(), values.size()); }
  void put(const std::vector<Vec3>& values) { list(values.data(), values.size()); }
  void put(const std::vector<Eigen::Quaterniond>& values) { list(values.data(), values.size()); }
  void put(const std::vector<Snap>& values) { list(values.data(), values.size()); }
  void put(const std::vector<ContactState>& values) { list(values.data(), values.size()); }
  void put(const std::vector<RigidState>& values) { list(values.data(), values.size()); }
  void put(const EnergyBalance& value) { raw(&value, sizeof value); }
  template <typename Value>
  void put(const std::optional<Value>& value) {
    (*this)(value.has_value());
    (*this)(value.value_or(Value{}));
  }
  template <typename First, typename Second>
  void put(const std::pair<First, Second>& pair) {
    (*this)(pair.first);
    (*this)(pair.second);
  }
  void put(const std::vector<std::pair<std::string, std::string>>& pairs) { each(pairs); }
  void put(const Eigen::VectorXd& values) { list(values.data(), narrow<std::size_t>(values.size())); }
  void put(const MotionMemory& value);
  template <typename Items>
  void each(const Items& items) {
    (*this)(narrow<std::uint64_t>(items.size()));
    for (const auto& item : items) {
      (*this)(item);
    }
  }

  std::string bytes_;
};

// Throws Damaged where the bytes end too early.
class Unpacker {
public:
  explicit Unpacker(std::string_view bytes) : bytes_(bytes) {}

  template <typename T>
  void operator()(T& value) {
    if constexpr (std::is_same_v<T, bool>) {
      unsigned char byte = 0;
      raw(&byte, 1);
      if (byte > 1) {
        throw Damaged();  // no bool may hold it
      }
      value = byte == 1;
    } else if constexpr (std::is_arithmetic_v<T>) {
      raw(&value, sizeof value);
    } else {
      get(value);
    }
  }

  void require_end() const {
    if (!bytes_.empty()) {
      throw Damaged();
    }
  }

private:
  void raw(void* data, std::size_t size) {
    if (size > bytes_.size()) {
      throw Damaged();
    }
    if (size > 0) {
      std::memcpy(data, bytes_.data(), size);
    }
    bytes_.remove_prefix(size);
  }
  std::size_t count(std::size_t item_bytes) {
    std::uint64_t number = 0;
    (*this)(number);
    if (number > bytes_.size() / item_bytes) {
      throw Damaged();
    }
    return narrow<std::size_t>(number);
  }
  template <typename List>
  void list(List& values) {
    values.resize(count(sizeof(typename List::value_type)));
    raw(static_cast<void*>(values.data()), values.size() * sizeof(typename List::value_type));
  }
  void get(std::string& text) { list(text); }
  void get(std::vector<double>& values) { list(values); }
  void get(std::vector<Vec3>& values) { list(values); }
  void get(std::vector<Eigen::Quaterniond>& values) { list(values); }
  void get(std::vector<Snap>& values) { list(values); }
  void get(std::vector<ContactState>& values) { list(values); }
  void get(std::vector<RigidState>& values) { list(values); }
  void get(EnergyBalance& value) { raw(&value, sizeof value); }
  template <typename Value>
  void get(std::optional<Value>& value) {
    bool there = false;
    Value content{};
    (*this)(there);
    (*this)(content);
    value = there ? std::optional(content) : std::nullopt;
  }
  void get(std::vector<std::pair<std::string, std::string>>& pairs) {
    pairs.resize(count(2 * sizeof(std::uint64_t)));
    for (auto& [first, second] : pairs) {
      get(first);
      get(second);
    }
  }
  void get(Eigen::VectorXd& values) {
    values.resize(narrow<Eigen::Index>(count(sizeof(double))));
    raw(values.data(), narrow<std::size_t>(values.size()) * sizeof(double));
  }
  void get(MotionMemory& value);

  std::string_view bytes_;
};

template <typename Archive, typename... Members>
void each(Archive& archive, Members&... members) {
  (archive(members), ...);
}

// Every member of what is stored, in one order for writing and reading. The bindings do not compile when a struct gets
// a member that is not stored.
template <typename Archive, typename Identity>
void identity_members(Archive& archive, Identity& identity) {
  auto& [tunica, scene, command, inputs, meshes, options] = identity;
  each(archive, tunica, scene, command, inputs, meshes, options);
}

template <typename Archive, typename AnyState>
void state_members(Archive& archive, AnyState& state) {
  auto& [time, load_factor, displacement, rotation, velocity, angular_velocity, pressure, volume, strain, kinetic,
         residual, newton_iterations, cg_iterations, error, error_is_bound, converged, linear, contacts, rigids,
         force_imbalance, moment_imbalance] = state;
  each(archive, time, load_factor, displacement, rotation, velocity, angular_velocity, pressure, volume, strain,
       kinetic, residual, newton_iterations, cg_iterations, error, error_is_bound, converged, linear, contacts, rigids,
       force_imbalance, moment_imbalance);
}

template <typename Archive, typename AnyMemory>
void motion_members(Archive& archive, AnyMemory& memory) {
  auto& [velocity, acceleration, auxiliary, acting, touching, last_change, part, at_rest, viscous_rate,
         deformation_before, length_before] = memory;
  each(archive, velocity, acceleration, auxiliary, acting, touching, last_change, part, at_rest, viscous_rate,
       deformation_before, length_before);
}

void Packer::put(const MotionMemory& value) { motion_members(*this, value); }
void Unpacker::get(MotionMemory& value) { motion_members(*this, value); }

template <typename Archive, typename AnyCheckpoint>
void checkpoint_members(Archive& archive, AnyCheckpoint& checkpoint) {
  auto& [summary, position, displacement, rotation, solid_pressure, contact, increment, rates] = checkpoint;
  auto& [dof, steps, parts, converged, residual, newton_iterations, cg_iterations, error, error_is_bound, volume_before,
         volume_after, strain, largest, departure, seconds_per_step, frequencies, factors, stiffened, energy, bend,
         motion, snaps, limits, branches, short_of, unstable, contact_pressures] = summary;
  each(archive, dof, steps, parts, converged, residual, newton_iterations, cg_iterations, error, error_is_bound,
       volume_before, volume_after, strain, largest, departure, seconds_per_step, frequencies, factors, stiffened,
       energy, bend, motion, snaps, limits, branches, short_of, unstable, contact_pressures);
  each(archive, position, displacement, rotation, solid_pressure, contact, increment, rates);
}

std::uint32_t checksum(std::string_view bytes) {
  return narrow<std::uint32_t>(::crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

// Length, checksum, bytes.
std::string record_of(const std::string& bytes) {
  Packer head;
  head(narrow<std::uint64_t>(bytes.size()));
  head(checksum(bytes));
  return head.bytes() + bytes;
}

constexpr std::size_t record_head = sizeof(std::uint64_t) + sizeof(std::uint32_t);

// What two scenes say differently first; meshes are compared by their bytes elsewhere.
std::string scene_difference(const std::string& before, const std::string& now) {
  constexpr std::array<std::string_view, 2> mesh_keys{"mesh = ", "fill = "};
  std::istringstream old_lines(before);
  std::istringstream new_lines(now);
  std::string old_line, new_line, section;
  while (true) {
    const bool old_there = static_cast<bool>(std::getline(old_lines, old_line));
    const bool new_there = static_cast<bool>(std::getline(new_lines, new_line));
    if (!old_there && !new_there) {
      return {};
    }
    if (!old_there || !new_there) {
      return fmt::format("the scene {} '{}'", old_there ? "no longer has" : "now also has",
                         old_there ? old_line : new_line);
    }
    const bool both_name_a_mesh = std::ranges::any_of(
        mesh_keys, [&](std::string_view key) { return old_line.starts_with(key) && new_line.starts_with(key); });
    if (old_line != new_line && !both_name_a_mesh) {
      return fmt::format("{}'{}' was '{}'", section.empty() ? "" : "in " + section + " ", new_line, old_line);
    }
    if (new_line.starts_with('[')) {
      section = new_line;
    }
  }
}

}  // namespace

std::string difference(const RunIdentity& before, const RunIdentity& now) {
  if (before.version != now.version) {
    return fmt::format("it was begun by tunica {}, this is {}", before.version, now.version);
  }
  if (const std::string scene = scene_difference(before.scene, now.scene); !scene.empty()) {
    return scene;
  }
  TUNICA_ASSERT(before.meshes.size() == now.meshes.size());  // the scenes are the same
  for (std::size_t i = 0; i < before.meshes.size(); ++i) {
    if (before.meshes[i].second != now.meshes[i].second) {
      return fmt::format("the mesh {} is not the one that the run was begun with", now.meshes[i].first);
    }
  }
  for (std::size_t i = 0; i < std::max(before.options.size(), now.options.size()); ++i) {
    if (i >= before.options.size() || i >= now.options.size() || before.options[i] != now.options[i]) {
      const auto text = [&](const RunIdentity& identity) {
        return i < identity.options.size() ? fmt::format("{} {}", identity.options[i].first, identity.options[i].second)
                                           : std::string("nothing");
      };
      return fmt::format("it now has {} where it had {}", text(now), text(before));
    }
  }
  return {};
}

struct RunJournal::Implementation {
  Implementation(const fs::path& the_part, int flags)
      : part(the_part), states_path(part), checkpoint_path(part), lock(PartLock::take(part)) {
    states_path += ".states";
    checkpoint_path += ".checkpoint";
    descriptor = open_own_file(states_path, flags);
  }
  ~Implementation() {
    if (descriptor >= 0) {
      ::close(descriptor);
    }
  }
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;

  void write(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) {
        continue;
      }
      if (written < 0) {
        throw OutputError(fmt::format("{}: cannot be written: {}", states_path.string(), file_error()));
      }
      bytes.remove_prefix(narrow<std::size_t>(written));
      size += narrow<std::uint64_t>(written);
    }
  }

  // Bytes of the next record; none at a clean end. Throws Damaged.
  std::optional<std::string> read_record() {
    std::string head(record_head, '\0');
    const std::size_t got = read(head);
    if (got == 0) {
      return std::nullopt;
    }
    std::uint64_t length = 0;
    std::uint32_t expected = 0;
    Unpacker unpack(std::string_view(head).substr(0, got));
    unpack(length);
    unpack(expected);
    if (length > largest_record || length > file_size - size) {
      throw Damaged();
    }
    std::string bytes(narrow<std::size_t>(length), '\0');
    if (read(bytes) != bytes.size() || checksum(bytes) != expected) {
      throw Damaged();
    }
    return bytes;
  }

  std::size_t read(std::string& into) {
    std::size_t got = 0;
    while (got < into.size()) {
      const ssize_t more = ::read(descriptor, into.data() + got, into.size() - got);
      if (more < 0 && errno == EINTR) {
        continue;
      }
      if (more <= 0) {
        break;
      }
      got += narrow<std::size_t>(more);
    }
    size += got;
    return got;
  }

  [[noreturn]] void fail(const fs::path& file) const {
    throw InputError(fmt::format("{}: is damaged: the run cannot go on, start it again", file.string()));
  }

  void read_identity() {
    std::error_code error;
    file_size = fs::file_size(states_path, error);
    try {
      std::string magic(states_magic.size(), '\0');
      if (error || read(magic) != magic.size() || magic != states_magic) {
        throw Damaged();
      }
      const auto bytes = read_record();
      if (!bytes) {
        throw Damaged();
      }
      identity_checksum = checksum(*bytes);
      Unpacker unpack(*bytes);
      identity_members(unpack, identity);
      unpack.require_end();
    } catch (const Damaged&) {
      fail(states_path);
    }
    header_size = size;
  }

  void read_checkpoint() {
    if (!fs::exists(checkpoint_path)) {
      return;
    }
    const std::string bytes = read_file(checkpoint_path);
    try {
      const std::size_t head = checkpoint_magic.size() + sizeof(std::uint32_t);
      if (bytes.size() < head || !bytes.starts_with(checkpoint_magic)) {
        throw Damaged();
      }
      std::uint32_t expected = 0;
      std::memcpy(&expected, bytes.data() + checkpoint_magic.size(), sizeof expected);
      const std::string_view content = std::string_view(bytes).substr(head);
      if (checksum(content) != expected) {
        throw Damaged();
      }
      Unpacker unpack(content);
      std::uint32_t of_identity = 0;
      unpack(of_identity);
      unpack(kept_states);
      unpack(kept_size);
      checkpoint_members(unpack, checkpoint.emplace());
      unpack.require_end();
      // Every step leaves its seconds, so the size of the file bounds how many there can be.
      const Summary& summary = checkpoint->summary;
      if (of_identity != identity_checksum || summary.steps != summary.seconds_per_step.size()) {
        throw Damaged();
      }
    } catch (const Damaged&) {
      fail(checkpoint_path);
    }
  }

  void require_whole_states() {
    try {
      while (size < kept_size) {
        if (kept_size > file_size || !read_record()) {
          throw Damaged();
        }
      }
    } catch (const Damaged&) {
      fail(states_path);
    }
    go_to(header_size);
  }

  void go_to(std::uint64_t place) {
    if (::lseek(descriptor, narrow<off_t>(place), SEEK_SET) < 0) {
      throw InputError(fmt::format("{}: cannot be read: {}", states_path.string(), file_error()));
    }
    size = place;
  }

  void save(const Checkpoint& now) {
    Packer pack;
    pack(identity_checksum);
    pack(states);
    pack(size);
    checkpoint_members(pack, now);
    Packer head;
    head(checksum(pack.bytes()));
    // The states first: the checkpoint must never know more of them than the disk does.
    if (::fdatasync(descriptor) != 0 && errno != EINVAL && errno != EROFS) {
      throw OutputError(fmt::format("{}: cannot be flushed to the disk: {}", states_path.string(), file_error()));
    }
    write_file(checkpoint_path, std::string(checkpoint_magic) + head.bytes() + pack.bytes(), true);
  }

  fs::path part;
  fs::path states_path;
  fs::path checkpoint_path;
  std::shared_ptr<PartLock> lock;  ///< on `part`, for all three
  int descriptor = -1;
  RunIdentity identity;
  std::uint32_t identity_checksum = 0;
  std::uint64_t file_size = 0;    ///< as it was found
  std::uint64_t header_size = 0;  ///< up to the first state
  std::uint64_t size = 0;         ///< read or written so far
  std::uint64_t states = 0;
  std::optional<Checkpoint> checkpoint;
  std::uint64_t kept_states = 0;  ///< that belong to the checkpoint
  std::uint64_t kept_size = 0;
  bool created = false;
  Clock::time_point due = Clock::now();
};

RunJournal::RunJournal(std::unique_ptr<Implementation> implementation) : implementation_(std::move(implementation)) {}
RunJournal::RunJournal(RunJournal&&) noexcept = default;

RunJournal::~RunJournal() {
  if (implementation_ && implementation_->created) {
    std::error_code missing;
    const auto bytes = fs::file_size(implementation_->part, missing);
    if (missing || bytes == 0) {
      remove();
    }
  }
}

RunJournal RunJournal::create(const fs::path& part, RunIdentity identity) {
  auto journal = std::make_unique<Implementation>(part, O_CREAT);
  // From what goes on to what it goes on with: whenever this is cut short, no old checkpoint meets new states.
  std::error_code ignored;
  fs::remove(journal->checkpoint_path, ignored);
  journal->lock->empty();
  if (::ftruncate(journal->descriptor, 0) != 0) {
    throw OutputError(fmt::format("{}: cannot be written: {}", journal->states_path.string(), file_error()));
  }
  Packer pack;
  identity_members(pack, identity);
  journal->identity_checksum = checksum(pack.bytes());
  RunJournal created(std::move(journal));  // from here on it removes what it does not get to
  Implementation& begun = *created.implementation_;
  begun.created = true;
  begun.write(std::string(states_magic) + record_of(pack.bytes()));
  begun.header_size = begun.size;
  begun.identity = std::move(identity);
  return created;
}

RunJournal RunJournal::open(const fs::path& part) {
  fs::path whole = part;
  whole.replace_extension();
  fs::path states = part;
  states += ".states";
  // NAME.part is written anew, and is not there where the disk was too full even for that.
  if (!fs::exists(part) && (fs::exists(whole) || !fs::exists(states))) {
    throw InputError(fs::exists(whole) ? fmt::format("{}: no such file: {} is complete, there is nothing to resume",
                                                     part.string(), whole.string())
                                       : fmt::format("{}: no such file: there is nothing to resume", part.string()));
  }
  auto journal = std::make_unique<Implementation>(part, 0);
  if (journal->descriptor < 0) {
    throw InputError(
        fmt::format("{}: cannot be resumed: {} is not beside it, which a run leaves when it is interrupted, and "
                    "not when it has failed",
                    part.string(), journal->states_path.filename().string()));
  }
  journal->read_identity();
  journal->read_checkpoint();
  journal->require_whole_states();  // before anybody replaces NAME.part
  return RunJournal(std::move(journal));
}

bool RunJournal::can_go_on(const fs::path& part) {
  const auto begins = [&](const char* ending, std::string_view magic) {
    fs::path file = part;
    file += ending;
    std::error_code error;
    if (!fs::is_regular_file(file, error)) {
      return false;
    }
    std::string start(magic.size(), '\0');
    std::ifstream bytes(file, std::ios::binary);
    return bytes.read(start.data(), narrow<std::streamsize>(start.size())) && start == magic;
  };
  return begins(".states", states_magic) && begins(".checkpoint", checkpoint_magic);
}

const RunIdentity& RunJournal::identity() const { return implementation_->identity; }

std::optional<Checkpoint> RunJournal::replay(const Model& model, const std::function<void(const State&)>& on_state) {
  Implementation& journal = *implementation_;
  const std::size_t nodes = model.node_count();
  const std::uint64_t end = journal.checkpoint ? journal.kept_size : journal.header_size;
  const auto fits = [&](const auto& list) { return list.empty() || list.size() == nodes; };
  const auto one_of_each = [](const auto& list, const auto& of) { return list.empty() || list.size() == of.size(); };
  if (journal.checkpoint && !(fits(journal.checkpoint->displacement) && fits(journal.checkpoint->rotation))) {
    journal.fail(journal.checkpoint_path);
  }
  while (journal.size < end) {
    State state;
    try {
      const auto bytes = journal.read_record();
      if (!bytes) {
        throw Damaged();
      }
      Unpacker unpack(*bytes);
      state_members(unpack, state);
      unpack.require_end();
      if (state.displacement.size() != nodes || state.rotation.size() != nodes || !fits(state.velocity) ||
          !fits(state.angular_velocity) || !one_of_each(state.contacts, model.contacts) ||
          !one_of_each(state.rigids, model.rigids)) {
        throw Damaged();
      }
    } catch (const Damaged&) {
      journal.fail(journal.states_path);
    }
    ++journal.states;
    on_state(state);
  }
  if (journal.size != end || (journal.checkpoint && journal.states != journal.kept_states)) {
    journal.fail(journal.states_path);
  }
  if (::ftruncate(journal.descriptor, narrow<off_t>(end)) != 0) {
    throw OutputError(fmt::format("{}: cannot be written: {}", journal.states_path.string(), file_error()));
  }
  return journal.checkpoint;
}

void RunJournal::append(const State& state) {
  Packer pack;
  state_members(pack, state);
  implementation_->write(record_of(pack.bytes()));
  ++implementation_->states;
}

void RunJournal::offer(const std::function<Checkpoint()>& make) {
  const auto start = Clock::now();
  if (start < implementation_->due) {
    return;
  }
  implementation_->save(make());
  const auto end = Clock::now();
  implementation_->due = end + spacing * (end - start);
}

void RunJournal::remove() {
  for (const fs::path& file : {implementation_->checkpoint_path, implementation_->states_path}) {
    std::error_code ignored;
    fs::remove(file, ignored);
  }
}

}  // namespace tunica

#include "fuzz/journal_model.hpp"
#include "fuzz/target.hpp"

#include "tunica/io/result/run_journal.hpp"

#include <zlib.h>

#include <cstring>
#include <optional>

namespace tunica::fuzz {
namespace {

constexpr std::size_t states_mark = 16;      // bytes of the line that the states begin with
constexpr std::size_t checkpoint_mark = 20;  // the same of a checkpoint

template <typename Number>
std::optional<Number> number_at(const std::string& bytes, std::size_t at) {
  Number number{};
  if (at > bytes.size() || bytes.size() - at < sizeof number) {
    return std::nullopt;
  }
  std::memcpy(&number, bytes.data() + at, sizeof number);
  return number;
}

std::uint32_t checksum(const char* bytes, std::size_t size) {
  return static_cast<std::uint32_t>(::crc32_z(0, reinterpret_cast<const Bytef*>(bytes), size));
}

void put(std::string& bytes, std::size_t at, std::uint32_t number) {
  std::memcpy(bytes.data() + at, &number, sizeof number);
}

// Gives every record the checksum of its bytes. @return that of the first
std::uint32_t repair_states(std::string& states) {
  std::uint32_t of_identity = 0;
  std::size_t at = states_mark;
  while (const auto length = number_at<std::uint64_t>(states, at)) {
    const std::size_t begin = at + 12;
    if (begin > states.size() || *length > states.size() - begin) {
      break;
    }
    const std::uint32_t sum = checksum(states.data() + begin, *length);
    put(states, at + 8, sum);
    of_identity = at == states_mark ? sum : of_identity;
    at = begin + *length;
  }
  return of_identity;
}

void repair_checkpoint(std::string& checkpoint, std::uint32_t of_identity) {
  const std::size_t begin = checkpoint_mark + 4;
  if (checkpoint.size() >= begin + 4) {
    put(checkpoint, begin, of_identity);
    put(checkpoint, checkpoint_mark, checksum(checkpoint.data() + begin, checkpoint.size() - begin));
  }
}

void read_journal(const Model& model, const std::string& states, const std::string& checkpoint) {
  const std::filesystem::path part = file("a.hdf.part", "some bytes");
  file("a.hdf.part.states", states);
  if (!checkpoint.empty()) {
    file("a.hdf.part.checkpoint", checkpoint);
  } else {
    std::filesystem::remove(folder() / "a.hdf.part.checkpoint");
  }
  accepted(
      [&] {
        RunJournal journal = RunJournal::open(part);
        RunIdentity other = journal.identity();
        (void)difference(journal.identity(), other);
        std::size_t states_read = 0;
        const auto last = journal.replay(model, [&](const State& state) {
          require(state.displacement.size() == model.node_count(), "a displacement for each node");
          ++states_read;
        });
        require(last.has_value() || states_read == 0, "states come with their checkpoint");
      },
      part.string());
}

}  // namespace
}  // namespace tunica::fuzz

// The journal of a run that goes on: four bytes that say how long the states are, the states, the checkpoint. Once as
// they are and once with checksums that are right, so that what lies behind them is reached.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica;
  static const Model model = fuzz::journal_model();
  const std::string bytes(fuzz::text_of(data, size));
  const auto length = fuzz::number_at<std::uint32_t>(bytes, 0);
  if (!length) {
    return 0;
  }
  std::string states = bytes.substr(4, *length);
  std::string checkpoint = *length < bytes.size() - 4 ? bytes.substr(4 + *length) : std::string();
  fuzz::read_journal(model, states, checkpoint);
  fuzz::repair_checkpoint(checkpoint, fuzz::repair_states(states));
  fuzz::read_journal(model, states, checkpoint);
  return 0;
}

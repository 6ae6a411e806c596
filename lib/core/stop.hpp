#pragma once

namespace tunica {

/// Whether check_interrupt() has thrown since the last request_stop(): the work is on its way to its end.
bool stop_was_seen() noexcept;

}  // namespace tunica

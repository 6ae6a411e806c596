#pragma once

#include <functional>

namespace tunica::cli {

/// Runs `work` where it has stack enough: here, where the limit (ulimit -s) allows 4 MiB or can be raised to that, else
/// on a thread with a stack of its own. What elements of shells keep on it is a quarter of a MiB. An exception of
/// `work` is rethrown. Where no such thread can be started, it runs here.
void with_enough_stack(const std::function<void()>& work);

}  // namespace tunica::cli

// Verilator's runtime names threads, which WebAssembly's library lacks; a model with one thread starts none.
#pragma once
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#ifndef _LIBCPP_HAS_THREADS
#define _LIBCPP_HAS_THREADS 0
#endif
#if !_LIBCPP_HAS_THREADS
#define thread_local // Of the only thread
namespace std {
class mutex {
public:
    void lock() {}
    void unlock() {}
    bool try_lock() { return true; }
};
class thread {
public:
    using id = int;
    thread() = default;
    template <class... Arguments> explicit thread(Arguments&&...) {}
    void join() {}
    bool joinable() const { return false; }
    static unsigned hardware_concurrency() { return 1; }
};
class condition_variable_any {
public:
    template <class Lock> void wait(Lock&) {}
    template <class Lock, class Predicate> void wait(Lock&, Predicate) {}
    void notify_one() {}
    void notify_all() {}
};
namespace this_thread {
inline int get_id() { return 0; }
inline void yield() {}
} // namespace this_thread
} // namespace std
#endif

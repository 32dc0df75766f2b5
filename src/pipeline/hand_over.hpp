// How one thread hands frames to the next: the interface of the two hand-overs.
#pragma once

namespace groundline::pipeline {

// One producer thread, one consumer thread, a fixed set of slots that never move. A slot belongs to exactly
// one side at any time:
//
//   producer:  T& slot = begin_write();  ...fill...  commit();
//   consumer:  T* slot = take();         ...read...  release();
//
// What differs is what happens when the consumer is slow: TripleBuffer overwrites (newest first, counted),
// Ring makes the producer wait (lossless). No allocation, no mutex; waiting is on a futex.
template <typename T>
class HandOver {
  public:
    HandOver() = default;
    HandOver(const HandOver&) = delete;
    HandOver& operator=(const HandOver&) = delete;
    virtual ~HandOver() = default;

    // Producer. The slot to fill, or nullptr after close(): nobody will read any more. Without a commit() in
    // between it is the same slot again.
    virtual T* begin_write() = 0;
    // Producer. Hands over the slot of the last begin_write(). True where that cost a committed slot that no
    // one had taken: it is lost, and whoever counts losses counts it now.
    virtual bool commit() = 0;
    // Producer. No more will come; the consumer still gets what was committed.
    virtual void end_of_stream() = 0;
    // Consumer. Waits for the next slot; nullptr after the end of the stream or after close().
    virtual T* take() = 0;
    // Consumer. Gives back the slot of the last take().
    virtual void release() = 0;
    // Any thread. Both sides stop waiting and get nullptr from now on.
    virtual void close() = 0;
};

}  // namespace groundline::pipeline

// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#define OMPI_SKIP_MPICXX 1
#include <mpi.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "assembly_cell/study/ledger.h"

namespace assembly_cell {

/// The processes of one study under mpirun. Rank 0 keeps the ledger, hands out blocks of runs and
/// works itself; the others request, work and send records. While a rank works on a block the next
/// is on its way, so that no rank waits for an answer. All waiting is asleep.
class Ranks {
 public:
  /// True when a launcher of MPI has started this process.
  static bool launched();

  Ranks();
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  int rank() const { return rank_; }
  int size() const { return size_; }

  /// True on all ranks when `text` is the same on all and `good` everywhere. Collective.
  bool agree(const std::string& text, bool good) const;

  /// Rank 0: does what the ledger offers, with all ranks. A rank that received a signal stops all.
  void serve(const Study& study, StudyLedger& ledger, int threads, std::atomic<bool>& stop);
  /// Rank 0: the others may leave.
  void release();
  /// Other ranks: work until released.
  void work(const Study& study, int threads, const std::atomic<bool>& stop) const;

 private:
  struct Block {
    std::int64_t runs = 0;
    std::string bytes;  // its tasks, valid once they have arrived
    MPI_Request request = MPI_REQUEST_NULL;
  };
  struct Peer {
    std::deque<Block> blocks;  // at work and waiting
    double since = 0.0;        // when it began with the first of them [s]
    double run_time = 0.0;     // measured duration of a run [s]; 0: not measured yet
  };
  void receive(StudyLedger& ledger, std::atomic<bool>& stop, bool& any);
  void handOut(StudyLedger& ledger, int threads);

  int rank_ = 0, size_ = 1;
  std::vector<Peer> peers_;
};

}  // namespace assembly_cell

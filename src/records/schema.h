// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Tables of a store of runs: docs/reference/records.md.
#pragma once

#include <array>

namespace assembly_cell {

/// PRAGMA application_id of a store: "ACrd".
constexpr int kApplicationId = 0x41437264;

/// What brings a store to the next version of the schema, from none on. PRAGMA user_version is the
/// number of those that were carried out. A released one never changes.
constexpr std::array<const char*, 2> kMigrations{
    // tables
    R"(CREATE TABLE part(
         id INTEGER PRIMARY KEY,
         serial TEXT NOT NULL,
         program TEXT NOT NULL,
         program_hash TEXT NOT NULL,
         station TEXT NOT NULL,
         UNIQUE(serial, program, program_hash, station));
       CREATE TABLE run(
         id INTEGER PRIMARY KEY,
         part INTEGER NOT NULL REFERENCES part(id),
         start REAL NOT NULL,
         duration REAL NOT NULL,
         strategy TEXT NOT NULL,
         result TEXT NOT NULL,
         failure TEXT NOT NULL,
         text TEXT NOT NULL,
         peak_force REAL,
         seating_depth REAL,
         verdicts INTEGER NOT NULL,
         failed INTEGER NOT NULL);
       CREATE TABLE property(
         run INTEGER NOT NULL REFERENCES run(id),
         kind TEXT NOT NULL,
         key TEXT NOT NULL,
         value TEXT NOT NULL,
         PRIMARY KEY(run, kind, key)) WITHOUT ROWID;
       CREATE TABLE curve(
         run INTEGER PRIMARY KEY REFERENCES run(id),
         samples INTEGER NOT NULL,
         data BLOB NOT NULL);
       CREATE TABLE estimate(
         run INTEGER NOT NULL REFERENCES run(id),
         position INTEGER NOT NULL,
         name TEXT NOT NULL,
         value REAL NOT NULL,
         sd REAL NOT NULL,
         PRIMARY KEY(run, position)) WITHOUT ROWID;
       CREATE TABLE verdict(
         run INTEGER NOT NULL REFERENCES run(id),
         position INTEGER NOT NULL,
         rule TEXT NOT NULL,
         kind TEXT NOT NULL,
         passed INTEGER NOT NULL,
         margin REAL,
         depth REAL,
         quantity TEXT NOT NULL,
         text TEXT NOT NULL,
         PRIMARY KEY(run, position)) WITHOUT ROWID;
       CREATE TABLE event(
         run INTEGER NOT NULL REFERENCES run(id),
         position INTEGER NOT NULL,
         time REAL NOT NULL,
         kind TEXT NOT NULL,
         text TEXT NOT NULL,
         PRIMARY KEY(run, position)) WITHOUT ROWID;)",
    // lists of a day and trends without a search of all runs, runs of a part
    R"(CREATE INDEX run_start ON run(start, peak_force, seating_depth, duration);
       CREATE INDEX run_part ON run(part);)"};

}  // namespace assembly_cell

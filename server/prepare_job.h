#pragma once
// The desk at which a job begins: its scene is read, and its tables are looked up, waited for, or begun to be made.

#include "server/office.h"

namespace lightloom {

/// Reads the scene of a job that was accepted, on a thread of its own, and goes on from there.
void start_preparing(Office& office, OpenBook& book, const JobPtr& file);
/// Goes on with a job that waited for the tables of another one, which has made them or will not.
void start_taking_over(Office& office, OpenBook& book, const JobPtr& file);

/// True if another job makes the tables that this one needs; then it waits for them, and makes none itself.
bool wait_for_maker(OpenBook& book, const JobPtr& file);
/// Opens a round of training units. What an earlier coordinator has of it is entered.
void open_training(Office& office, OpenBook& book, const JobPtr& file, UnitKind kind, uint32_t round, const TrainingWork& work);
/// The first round of the set that the job's spec names. From now on others may wait for its tables.
void open_first_round(Office& office, OpenBook& book, const JobPtr& file);

}  // namespace lightloom

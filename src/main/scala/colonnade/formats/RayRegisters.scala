package colonnade.formats

import chisel3._
import colonnade.config.ColonnadeConfig

/** The registers of a device for rays that the host writes while no batch runs. */
final class RayRegisters(config: ColonnadeConfig) extends Bundle with SceneRegisters {
  val bounds    = new Bounds(config.numbers)
  val scene     = new SceneMap(config)
  val dram      = config.columnBvhMemory.cache.map(_ => new SceneInDram)
  val placement = new RayPlacement
  val ring      = new RayRing
}

/** Of a device for rays: written at any time. */
final class RayCommands extends Bundle {

  /** Batches in the ring so far, modulo 2^16^: those from `head` to `tail` run. */
  val tail = UInt(RayRing.indexBits.W)
}

final class RayProgress extends Bundle {

  /** Batches that have ended, modulo 2^16^. */
  val head = UInt(RayRing.indexBits.W)
}

/** Sticky until a write to `control.start`. */
final class RayErrors(config: ColonnadeConfig) extends Bundle {
  val stackOverflow = Bool()
  val illegalRecord = Bool()
  val memory        = config.columnBvhMemory.cache.map(_ => Bool())

  /** A batch was refused, or has failed. */
  val batch = Bool()
}

/** Sums since the last write to `control.start`. */
final class RayCounters(config: ColonnadeConfig) extends Bundle {
  private def counter = UInt(Counters.bits(config).W)

  /** Cycles in which batches run. */
  val cycles        = counter
  val raysInBox     = counter
  val nodeReads     = counter
  val boxTests      = counter
  val triangleTests = counter

  /** Maximum number of entries of any stack. */
  val deepestStack = counter

  /** Completed rays, whose hits are in memory; malformed rays among them. */
  val rays        = counter
  val raysRefused = counter
}

/** The registers of a device for rays that the host reads. */
final class RayStatus(config: ColonnadeConfig) extends Bundle with BusyRegisters {
  val status   = new Status
  val errors   = new RayErrors(config)
  val counters = new RayCounters(config)
  val rays     = new RayProgress
}

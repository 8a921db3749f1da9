package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, PopCount}
import colonnade.config.ColonnadeConfig

/** Drives rays at any time into a [[RayBus]] with units that end their rays at any time and count their contexts. A unit
  * that is free counts a ray in the cycle after it comes, as [[colonnade.unit.TraversalUnit]] does.
  */
class RayBusProof(config: ColonnadeConfig) extends Module {
  private val rows     = config.array.rows
  private val contexts = config.array.contexts
  private val dut      = Module(new RayBus(config))

  val asks    = IO(Input(Bool()))
  val context = IO(Input(chiselTypeOf(dut.io.rays.bits.context)))
  val ends    = IO(Input(UInt(rows.W)))

  dut.io.rays.valid        := asks
  dut.io.rays.bits         := 0.U.asTypeOf(dut.io.rays.bits)
  dut.io.rays.bits.context := context

  private val used = RegInit(VecInit.fill(rows)(0.U(log2Ceil(contexts + 1).W)))
  for (row <- 0 until rows) {
    val comes = dut.io.units(row).valid
    dut.io.isFree(row) := used(row) =/= contexts.U
    used(row)          := used(row) + comes - (ends(row) && used(row) =/= 0.U)
    assert(!comes || used(row) =/= contexts.U, "a ray comes to a unit with an idle context")
  }

  private val came = RegNext(dut.io.rays.fire, false.B)
  assert(PopCount(dut.io.units.map(_.valid)) === came.asUInt, "each ray comes once, one cycle later")
  for (unit <- dut.io.units)
    assert(!unit.valid || unit.bits.context === RegNext(context), "the ray that comes is the one that was sent")

  private val isFree = used.zip(dut.io.units).map { case (count, unit) => count +& unit.valid =/= contexts.U }
  assert(
    dut.io.rays.ready === isFree.zip(dut.io.units).map { case (free, unit) => free && !unit.valid }.reduce(_ || _),
    "a ray is taken if a unit is free that gets none in this cycle"
  )
  cover(used.map(_ === contexts.U).reduce(_ && _), "all contexts are used")
  if (rows > 1) cover(came && RegNext(came, false.B), "two rays in two cycles")
}

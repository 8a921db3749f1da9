package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, PopCount}
import chiseltest._
import circt.stage.ChiselStage
import colonnade.{Proofs, TestConfigs}
import colonnade.config.ColonnadeConfig
import org.scalatest.flatspec.AnyFlatSpec

/** Drives rays at any time into a [[RayBus]] with units that end their rays at any time and count their contexts. A
  * unit that is free counts a ray in the cycle after it comes, as [[colonnade.unit.TraversalUnit]] does.
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

class RayBusSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "RayBus"

  for ((rows, contexts) <- Seq((1, 1), (2, 2), (3, 1)))
    it should s"send each ray once, to a unit with an idle context, with $rows units of $contexts" in
      prove(new RayBusProof(
        TestConfigs.tiny.copy(
          array = TestConfigs.tiny.array.copy(rows = rows, contexts = contexts),
          units = TestConfigs.tiny.units.copy(pathContexts = 4)
        )
      ))
}

/** Drives a [[ResultBus]] with units that offer results at any time; a result stays until it is taken. */
class ResultBusProof(config: ColonnadeConfig) extends Module {
  private val rows = config.array.rows
  private val dut  = Module(new ResultBus(config)).io

  val offers   = IO(Input(UInt(rows.W)))
  val contexts = IO(Input(Vec(rows, chiselTypeOf(dut.results.bits.context))))

  private val takes = dut.units.map(_.fire)
  for (((unit, offer), row) <- dut.units.zip(offers.asBools).zipWithIndex) {
    unit.valid        := offer
    unit.bits         := 0.U.asTypeOf(unit.bits)
    unit.bits.context := contexts(row)
    val waited = RegNext(offer && !unit.ready, false.B)
    assume(!waited || (offer && contexts(row) === RegNext(contexts(row))))

    val others = RegInit(0.U(log2Ceil(rows + 1).W))
    others := Mux(offer && !unit.ready, others + 1.U, 0.U)
    assert(others < rows.U, "a unit waits for one result of each other unit at most")
    assert(
      !RegNext(unit.fire, false.B) || dut.results.bits.context === RegNext(contexts(row)),
      "the result that comes is the one that was taken"
    )
  }
  assert(PopCount(takes) === offers.orR.asUInt, "one result a cycle, if there is one")
  assert(dut.results.valid === RegNext(PopCount(takes) =/= 0.U, false.B), "each result comes once, one cycle later")
  cover(offers.andR && RegNext(offers.andR, false.B), "all units offer a result, twice")
}

class ResultBusSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "ResultBus"

  private def configOf(rows: Int) = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(rows = rows),
    units = TestConfigs.tiny.units.copy(pathContexts = 4)
  )

  for (rows <- Seq(1, 3))
    it should s"give each result of $rows units once, and let none wait for long" in
      prove(new ResultBusProof(configOf(rows)))

  it should "elaborate without a warning" in {
    ChiselStage.emitCHIRRTL(new ResultBus(configOf(rows = 3)), Array("--warnings-as-errors"))
  }
}

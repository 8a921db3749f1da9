package colonnade.column

import chisel3._
import chisel3.util.{log2Ceil, PopCount}
import colonnade.config.ColonnadeConfig

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

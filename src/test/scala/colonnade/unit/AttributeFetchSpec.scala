package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, PopCount}
import chiseltest._
import colonnade.{Proofs, TestConfigs}
import colonnade.config.ColonnadeConfig
import colonnade.TestParts._
import org.scalatest.flatspec.AnyFlatSpec

class AttributeFetchSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "AttributeFetch"

  private def module(contexts: Int, slots: Int, hasColours: Boolean) = {
    val tiny   = TestConfigs.tiny
    val config = tiny.copy(
      columnBvhMemory = tiny.columnBvhMemory.copy(depth = 16, banks = 1),
      units = tiny.units.copy(pathContexts = contexts),
      geometry = tiny.geometry.copy(cornerColours = hasColours)
    )
    new AttributeFetchProof(config, slots)
  }

  // A device with colours has leaves without them, too
  for (hasColours <- Seq(false, true))
    it should s"answer each of the hits of two contexts once, by one slot, colours $hasColours" in
      prove(module(contexts = 2, slots = 1, hasColours))

  it should "answer each of the hits of three contexts once, by two slots" in
    proveUntil(cycles = 9)(module(contexts = 3, slots = 2, hasColours = false))
}

/** Drives [[AttributeFetch]] with hits of any contexts at any time, one of a context at a time, legal and beyond the
  * last record. One bank accepts reads and answers them in order at any time; records that others have read are
  * broadcast between its answers. The shader accepts responses at any time.
  */
class AttributeFetchProof(config: ColonnadeConfig, slots: Int) extends Module {
  import AttributeFetchProof._

  private val contexts = config.units.pathContexts
  private val dut      = Module(new AttributeFetch(config, slots)).io

  val hit          = IO(Input(Bool()))
  val context      = IO(Input(chiselTypeOf(dut.hits.bits.context)))
  val id           = IO(Input(chiselTypeOf(dut.hits.bits.id)))
  val accepts      = IO(Input(Bool()))
  val responds     = IO(Input(Bool()))
  val otherComes   = IO(Input(Bool()))
  val otherAddress = IO(Input(chiselTypeOf(dut.broadcasts.head.bits.address)))
  val readyNext    = IO(Input(Bool()))
  val wants        = IO(Input(Bool()))

  dut.start             := false.B
  dut.scene.root        := 0.U
  dut.scene.recordCount := recordCount.U
  dut.scene.hasColours.foreach(_ := true.B)
  dut.readyNext    := readyNext
  dut.wantsColours := wants
  if (!config.geometry.cornerColours) assume(!wants)

  // Hits
  private val pending  = RegInit(VecInit.fill(contexts)(false.B))
  private val ids      = Reg(Vec(contexts, chiselTypeOf(id)))
  private val coloured = Reg(Vec(contexts, Bool()))
  assume(!hit || context < contexts.U)
  assume(!hit || !pending(context), "one hit of a context at a time")
  dut.hits.valid        := hit
  dut.hits.bits.context := context
  dut.hits.bits.id      := id
  when(hit) {
    pending(context)  := true.B
    ids(context)      := id
    coloured(context) := false.B
  }

  // The bank, and records of others. A record tells its address
  private val held      = RegInit(0.U(log2Ceil(capacity + 1).W))
  private val underWay  = Reg(Vec(capacity, chiselTypeOf(otherAddress))) // the newest one first
  private val answers   = responds && held =/= 0.U
  private val broadcast = dut.broadcasts.head
  dut.requests.ready := accepts && held =/= capacity.U
  held               := held + dut.requests.fire - answers
  when(dut.requests.fire) { underWay := VecInit(dut.requests.bits.address +: underWay.init) }
  broadcast.valid        := answers || otherComes
  broadcast.bits.address := Mux(answers, underWay((held - 1.U)(log2Ceil(capacity) - 1, 0)), otherAddress)
  broadcast.bits.row     := Mux(answers, config.array.rows.U, 0.U)
  broadcast.bits.record  := broadcast.bits.address
  assert(!dut.requests.valid || dut.requests.bits.address < recordCount.U, "only legal addresses are read")

  // Answers: a leaf, or its companion and then the leaf
  private val answer                    = dut.response
  private val answered                  = answer.bits.hit
  private val isColours                 = answer.bits.isColours
  private def leaf(context: UInt): UInt = ids(context) >> 1
  when(answer.valid) {
    assert(pending(answered.context), "an answer to a hit, once")
    assert(answered.id === ids(answered.context), "the triangle of the hit")
    assert(answer.bits.record === leaf(answered.context) +& isColours, "the record of the hit")
    assert(isColours || RegNext(readyNext, false.B), "a leaf comes to a shader that is ready")
    assert(!isColours || !coloured(answered.context), "colours come once")
    assert(isColours || coloured(answered.context) || !wants, "a leaf that wants colours has them")
    pending(answered.context)  := isColours
    coloured(answered.context) := isColours
  }
  when(dut.error.valid) {
    assert(pending(dut.error.bits), "an error of a hit, once")
    assert(
      leaf(dut.error.bits) +& config.geometry.cornerColours.B >= recordCount.U,
      "an error only where an address is illegal"
    )
    pending(dut.error.bits) := false.B
  }
  assert(!answer.valid || !dut.error.valid || answered.context =/= dut.error.bits, "an answer or an error")

  // No hang: if the bank has answered and the shader is ready, something happens soon
  private val progress = answer.valid || dut.error.valid || dut.requests.valid || held =/= 0.U || !readyNext
  private val quiet    = RegInit(0.U(log2Ceil(maxQuiet + 2).W))
  quiet := Mux(pending.asUInt.orR && !progress, quiet + 1.U, 0.U)
  assert(quiet <= maxQuiet.U, "a hit is answered")

  private val reads = RegInit(0.U(4.W))
  reads := reads + dut.requests.fire
  cover(PopCount(pending) > slots.U, "more hits than slots")
  cover(answer.valid && reads === 0.U, "a record that others have read")
  if (slots > 1) cover(answer.valid && RegNext(answer.valid, false.B), "two answers in two cycles")
  cover(dut.error.valid, "an illegal address")
  if (config.geometry.cornerColours) cover(answer.valid && coloured(answered.context), "a leaf after its companion")
}

object AttributeFetchProof {
  private val recordCount = 6

  /** Reads that the bank has accepted. */
  private val capacity = 2

  /** Cycles without progress of a pending hit: the queue, its slot, its record and the grant, twice. */
  private val maxQuiet = 8
}

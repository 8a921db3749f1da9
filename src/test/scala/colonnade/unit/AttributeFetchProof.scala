package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, PopCount}
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig

/** Drives [[AttributeFetch]] with hits of any contexts at any time, one of a context at a time, legal and beyond the last
  * record. One bank accepts reads and answers them in order at any time; records that others have read are broadcast
  * between its answers. The shader accepts responses at any time.
  */
class AttributeFetchProof(config: ColonnadeConfig, slots: Int) extends Module {
  import AttributeFetchProof._

  private val contexts = config.units.pathContexts
  private val dut      = Module(new AttributeFetch(config, slots)).io

  val hit          = IO(Input(Bool()))
  val context      = IO(Input(chiselTypeOf(dut.hits.bits.context)))
  val address      = IO(Input(chiselTypeOf(dut.hits.bits.address)))
  val accepts      = IO(Input(Bool()))
  val responds     = IO(Input(Bool()))
  val otherComes   = IO(Input(Bool()))
  val otherAddress = IO(Input(chiselTypeOf(dut.broadcasts.head.bits.address)))
  val readyNext    = IO(Input(Bool()))

  dut.start                 := false.B
  dut.scene.triangleBase    := 1.U
  dut.scene.triangleRecords := (attributeBase - 1).U
  dut.scene.attributeBase   := attributeBase.U
  dut.scene.recordCount     := recordCount.U
  dut.readyNext             := readyNext

  // Hits
  private val pending   = RegInit(VecInit.fill(contexts)(false.B))
  private val addresses = Reg(Vec(contexts, chiselTypeOf(address)))
  assume(!hit || context < contexts.U)
  assume(!hit || !pending(context), "one hit of a context at a time")
  assume(address >= attributeBase.U, "the address of a face")
  dut.hits.valid        := hit
  dut.hits.bits.context := context
  dut.hits.bits.address := address
  when(hit) {
    pending(context)   := true.B
    addresses(context) := address
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

  // Answers
  private val answer                     = dut.response
  private def asked(context: UInt): UInt = addresses(context)
  assert(answer.valid === RegNext(dut.grantNext.valid, false.B), "an answer follows its grant")
  assert(!answer.valid || RegNext(readyNext, false.B), "an answer comes to a shader that is ready")
  when(answer.valid) {
    assert(answer.bits.context === RegNext(dut.grantNext.bits), "the context of the grant")
    assert(pending(answer.bits.context), "an answer to a hit, once")
    assert(answer.bits.record === asked(answer.bits.context), "the record of the hit")
    pending(answer.bits.context) := false.B
  }
  when(dut.error.valid) {
    assert(pending(dut.error.bits), "an error of a hit, once")
    assert(asked(dut.error.bits) >= recordCount.U, "an error only where the address is illegal")
    pending(dut.error.bits) := false.B
  }
  assert(!answer.valid || !dut.error.valid || answer.bits.context =/= dut.error.bits, "an answer or an error")

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
}

object AttributeFetchProof {
  private val attributeBase = 2
  private val recordCount   = 6

  /** Reads that the bank has accepted. */
  private val capacity = 2

  /** Cycles without progress of a pending hit: the queue, its slot, its record and the grant. */
  private val maxQuiet = 4
}

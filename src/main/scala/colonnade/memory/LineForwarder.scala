package colonnade.memory

import chisel3._
import chisel3.util._
import colonnade.axi.{Axi, AxiReadData}
import colonnade.common.RoundRobin
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordFormats, SceneLines}

final class LineForwarderIO(config: ColonnadeConfig) extends Bundle {

  /** By column; may be withdrawn. */
  val requests = Vec(config.array.columns, Flipped(Decoupled(UInt(Lines.lineBits(config).W))))
  val lines    = Output(new LineBroadcast(config))

  /** Lines to read from DRAM, and their beats in the same order. */
  val reads = Decoupled(UInt(Lines.lineBits(config).W))
  val beats = Flipped(Decoupled(new AxiReadData(DramPort.idBits(config), config.columnBvhMemory.cache.get.busBytes)))

  /** The line that is announced was not read; its records count as 0. */
  val error  = Output(Bool())
  val isIdle = Output(Bool())
}

/** In the place of a [[SharedCache]] without lines: passes one bank's lines from DRAM to the columns;
  * docs/scene-cache.md. Beats are gathered in a memory of two lines, whose rows are records: nothing is as wide as a
  * line.
  */
final class LineForwarder(config: ColonnadeConfig) extends Module {
  private val cache    = config.columnBvhMemory.cache.get
  private val busBytes = cache.busBytes
  private val beats    = new RecordFormats(config).recordBits / (8 * busBytes) // of a record

  val io = IO(new LineForwarderIO(config))

  // A requested line is read, and awaited in order
  private val arbiter = Module(new RoundRobin(config.array.columns))
  private val awaited =
    Module(new Queue(UInt(Lines.lineBits(config).W), cache.sharedMisses / config.columnBvhMemory.banks))
  private val line = Mux1H(arbiter.io.grant, io.requests.map(_.bits))
  arbiter.io.requests := VecInit(io.requests.map(_.valid)).asUInt
  arbiter.io.isTaken  := io.reads.fire
  io.requests.zip(arbiter.io.grant.asBools).foreach { case (request, isGranted) =>
    request.ready := isGranted && awaited.io.enq.ready && io.reads.ready
  }
  io.reads.valid       := arbiter.io.requests.orR && awaited.io.enq.ready
  io.reads.bits        := line
  awaited.io.enq.valid := io.reads.fire
  awaited.io.enq.bits  := line

  // Beats are gathered
  private val gathered = Mem(2 * Lines.records, Vec(beats, UInt((8 * busBytes).W)))
  private val isWhole  = RegInit(VecInit.fill(2)(false.B))
  private val isError  = Reg(Vec(2, Bool()))
  private val row      = RegInit(0.U(log2Ceil(2 * Lines.records).W))
  private val beatOH   = RegInit(1.U(beats.W))
  private val half     = row(Lines.wordBits)
  io.beats.ready := !isWhole(half)
  when(io.beats.fire) {
    val isFirst = beatOH(0) && row(Lines.wordBits - 1, 0) === 0.U
    gathered.write(row, VecInit.fill(beats)(io.beats.bits.data), beatOH.asBools)
    isError(half) := (isError(half) && !isFirst) || io.beats.bits.resp =/= Axi.okay
    beatOH        := (if (beats == 1) 1.U else beatOH.rotateLeft(1))
    when(beatOH(beats - 1)) {
      row := row + 1.U
      when(row(Lines.wordBits - 1, 0).andR) { isWhole(half) := true.B }
    }
  }

  // A whole line is announced in step 1; its records are read in steps 3 and 4
  private val step     = RegInit(0.U(3.W))
  private val readHalf = RegInit(false.B)
  private val last     = (LineBroadcast.latency + Lines.records - 1).U
  when(step =/= 0.U || isWhole(readHalf)) { step := Mux(step === last, 0.U, step + 1.U) }
  when(step === last) {
    isWhole(readHalf) := false.B
    readHalf          := !readHalf
  }
  private val word   = (step + (2 * Lines.records - LineBroadcast.latency).U)(Lines.wordBits - 1, 0)
  private val record = Lines.withParity(config, gathered.read(readHalf ## word).asUInt)
  io.lines.announced.valid := step === 1.U
  io.lines.announced.bits  := awaited.io.deq.bits
  io.lines.record          := RegNext(Mux(isError(readHalf), 0.U, record))
  awaited.io.deq.ready     := step === 1.U
  io.error                 := step === 1.U && isError(readHalf)
  io.isIdle                := step === 0.U && !awaited.io.deq.valid
  assert(step =/= 1.U || awaited.io.deq.valid, "a line that was not read")
}

/** A line is two consecutive records. Lines 2n and 2n + 1, *buddies*, lie in bank n mod `banks`, as numbers 2 · (n /
  * `banks`) and the next one of that bank.
  */
object Lines {
  val records:  Int = SceneLines.records
  val wordBits: Int = log2Ceil(records)

  /** Width of the number of a line in its bank. */
  def lineBits(config: ColonnadeConfig): Int =
    RecordFormats.addressBits(config) - wordBits - log2Ceil(config.columnBvhMemory.banks)

  /** The other line of a pair. */
  def buddy(line: UInt): UInt = line ^ 1.U

  /** The number of a bank's line in the scene. */
  def numberOf(config: ColonnadeConfig, line: UInt, bank: UInt): UInt =
    (line >> 1).asUInt ## bank(log2Ceil(config.columnBvhMemory.banks) - 1, 0) ## line(0)

  /** Whether records have a parity bit from the DRAM port to their requesters. */
  def hasParity(config: ColonnadeConfig): Boolean = config.columnBvhMemory.cache.exists(_.parity)

  /** A record in a cache or on a bus: its parity is the most significant bit, if it has one. Zeros have the right
    * parity.
    */
  def stored(config: ColonnadeConfig): UInt =
    UInt((new RecordFormats(config).recordBits + (if (hasParity(config)) 1 else 0)).W)

  /** Adds the parity to a record. */
  def withParity(config: ColonnadeConfig, record: UInt): UInt = if (hasParity(config)) record.xorR ## record else record
}

/** From a bank of the shared cache to the same bank of every column: a line that was read.
  *
  * The records of the line follow its announcement after three and four cycles. The next announcement comes two cycles
  * later, or later than that. A column that awaits the line takes it; no column can delay it.
  */
final class LineBroadcast(config: ColonnadeConfig) extends Bundle {
  val announced = Valid(UInt(Lines.lineBits(config).W)) // the line's number in its bank
  val record    = Lines.stored(config)
}

object LineBroadcast {
  val latency: Int = 3 // cycles from an announcement to the line's first record
}

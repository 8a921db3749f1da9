package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.axi.AxiReadPort
import colonnade.common.TimingSlice
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.{AttributeMemories, Load, RecordFormats}

final class ImageLoaderIO(config: ColonnadeConfig, shell: ShellConfig) extends Bundle {

  /** A pulse, while idle; the settings are constant until idle. */
  val start    = Input(Bool())
  val settings = Input(new ImageSettings)
  val load     = Decoupled(new Load(config))
  val axi      = new AxiReadPort(BurstWriter.idBits, shell.busBytes)
  val isIdle   = Output(Bool())

  val errors = Output(new ImageError) // sticky until the next start
}

/** Loads a device image from memory: a header, then sections of words for the device's memories; docs/bus-shell.md.
  *
  * Nothing is read if the image leaves its window or is not aligned, nothing is loaded if its header is wrong. A later
  * error ends the load. A record takes a cycle for each of its 32-bit words, and one more.
  */
final class ImageLoader(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  val io = IO(new ImageLoaderIO(config, shell))

  private object State extends ChiselEnum {
    val idle, check, header, section, record, load, end = Value
  }
  private val state  = RegInit(State.idle)
  private val errors = RegInit(0.U.asTypeOf(new ImageError))
  private val reader = Module(new ImageReader(shell))
  private val word   = reader.io.words.bits
  private val takes  = reader.io.words.fire

  // Header
  private val position = Reg(UInt(5.W))
  private val expected = VecInit(ImageHeader.expected(config).padTo(ImageHeader.words, BigInt(0)).map(_.U(32.W)))
  private val sections = Reg(UInt(32.W))

  // Section
  private val shapes   = ImageLoader.shapes(config)
  private val target   = Reg(UInt(io.load.bits.target.getWidth.W))
  private val count    = Reg(UInt(32.W))
  private val address  = Reg(UInt(32.W))
  private val isTarget = shapes.map(shape => target === shape.target.U)
  private val length   = ofTarget(_.words)
  private val depth    = ofTarget(_.depth)

  /** A number of the section's memory, 0 if there is none. */
  private def ofTarget(number: ImageLoader.Shape => Int): UInt =
    isTarget.zip(shapes).map { case (is, shape) => Mux(is, number(shape).U, 0.U) }.foldLeft(0.U)(_ | _)

  // Record; words of narrower memories have undefined high bits
  private val widest = shapes.map(_.words).foldLeft(2)(_ max _)
  require(widest <= 32, "a record has at most 1024 bits")
  private val record = Reg(Vec(widest, UInt(32.W)))

  private val isAligned = !(io.settings.base | io.settings.bytes)(log2Ceil(ImageReader.burstBytes) - 1, 0).orR
  private val isInside  = TimingSlice(io.settings.window.contains(io.settings.base, io.settings.bytes))
  private val isEmpty   = io.settings.bytes === 0.U
  private val canRead   = isAligned && isInside && !isEmpty
  private val isShort   = reader.io.isIdle && !reader.io.words.valid // no word will come

  reader.io.start       := state === State.check && canRead
  reader.io.base        := io.settings.base
  reader.io.bytes       := io.settings.bytes
  reader.io.stop        := state === State.end
  reader.io.words.ready := state === State.header || state === State.section || state === State.record
  io.axi :<>= reader.io.axi

  private def refuse(error: ImageError => Bool): Unit = {
    error(errors) := true.B
    state         := State.end
  }
  private val rest = Reg(UInt(30.W)) // words that have not been taken
  when(takes) { rest := rest - 1.U }

  switch(state) {
    is(State.idle) {
      when(io.start) {
        errors := 0.U.asTypeOf(errors)
        state  := State.check
      }
    }
    is(State.check) {
      errors.window    := !isInside
      errors.alignment := !isAligned
      errors.length    := isEmpty
      state            := Mux(canRead, State.header, State.end)
      position         := 0.U
      rest             := io.settings.bytes >> 2
    }
    is(State.header) {
      when(takes) {
        position := position + 1.U
        when(position === ImageHeader.sectionsWord.U) {
          sections := word
        }.elsewhen(position === ImageHeader.bytesWord.U) {
          when(word =/= io.settings.bytes) { refuse(_.length) }
        }.elsewhen(word =/= expected(position)) {
          when(position < ImageHeader.hashWord.U || position > ImageHeader.sectionsWord.U) {
            refuse(_.magic)
          }.otherwise { refuse(_.formatHash) }
        }
        when(position.andR && word === 0.U) { state := State.section }
      }
    }
    is(State.section) {
      when(position === 0.U && sections === 0.U) {
        state := State.end
        when(rest >= (ImageReader.burstBytes / 4).U) { errors.length := true.B }
      }.elsewhen(takes) {
        position := position + 1.U
        switch(position(1, 0)) {
          is(0.U) { when(word >= (1 << target.getWidth).U) { refuse(_.section) }.otherwise { target := word } }
          is(1.U) { count := word }
          is(3.U) {
            position := 0.U
            address  := 0.U
            sections := sections - 1.U
            when(!isTarget.foldLeft(false.B)(_ || _) || count > depth) {
              refuse(_.section)
            }.elsewhen(count =/= 0.U) { state := State.record }
          }
        }
      }.elsewhen(isShort) { refuse(_.length) }
    }
    is(State.record) {
      when(takes) {
        record(position(log2Ceil(widest) - 1, 0)) := word
        position                                  := position + 1.U
        when(position === length - 1.U) { state := State.load }
      }.elsewhen(isShort) { refuse(_.length) }
    }
    is(State.load) {
      when(io.load.ready) {
        position := 0.U
        address  := address + 1.U
        state    := Mux(address + 1.U === count, State.section, State.record)
      }
    }
    is(State.end) { when(reader.io.isIdle) { state := State.idle } }
  }
  when(reader.io.isError) { refuse(_.response) }

  io.load.valid        := state === State.load
  io.load.bits.target  := target
  io.load.bits.address := address
  io.load.bits.record  := Cat(record.reverse)
  io.isIdle            := state === State.idle
  io.errors            := errors
}

object ImageLoader {

  /** A memory of the device: `words` of 32 bits for each of at most `depth` records. */
  final case class Shape(target: Int, words: Int, depth: Int)

  /** All memories that an image may fill. With a cache the scene lies in DRAM; without an environment there are none
    * then.
    */
  def shapes(config: ColonnadeConfig): Seq[Shape] = {
    val records = Shape(0, new RecordFormats(config).recordBits / 32, config.columnBvhMemory.depth)
    Option.when(config.columnBvhMemory.cache.isEmpty)(records).toSeq ++
      AttributeMemories(config).map(memory => Shape(memory.target, (memory.bits + 31) / 32, memory.depth))
  }
}

/** The header of a device image, in words of 32 bits; the rest of its 128 bytes is 0. */
object ImageHeader {
  val words: Int = ImageReader.burstBytes / 4

  /** The format hash, the size in bytes, the number of sections. */
  val hashWord:     Int = 4
  val bytesWord:    Int = 3
  val sectionsWord: Int = 12

  /** "CLNDLOAD", the version, the words that follow, and the hash. */
  def expected(config: ColonnadeConfig): Seq[BigInt] =
    Seq(BigInt(0x444e4c43), BigInt(0x44414f4c), BigInt(1), BigInt(0)) ++ ShellMap.formatHash(config)
}

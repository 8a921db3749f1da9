package colonnade.shading

import chisel3._
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.config.{PathConfig, TextureLayout}
import colonnade.formats.{AlbedoEntry, FrameRegisters, Rgb}

/** A texel of the atlas. */
final class TexelPosition(layout: TextureLayout) extends Bundle {
  val x = UInt(layout.xBits.W)
  val y = UInt(layout.yBits.W)
}

/** The colour of a texel. */
final class Texel extends Bundle {
  val isIllegal = Bool() // a word beyond the heap was read as 0
  val colour    = new AlbedoEntry
}

/** A path unit's port to the textures. Responses come in the order of the requests and cannot be stalled. */
final class TexturePort(config: PathConfig) extends Bundle {
  val req  = Decoupled(new TexelPosition(TextureLayout.of(config.device)))
  val resp = Flipped(Valid(new Texel))
}

final class TextureLookupIO(config: PathConfig) extends Bundle {
  val start = Input(Bool()) // a hit enters; the one before must be done, or must not use its texture

  /** The position is known and the hit uses it; never in the cycle after reset's end, or with `start`'s hit before. */
  val isKnown = Input(Bool())

  /** Red and green are the position in the atlas, texels with `fractionBits` fraction bits. */
  val position = Input(Rgb(FrameRegisters.colour))
  val port     = new TexturePort(config)

  val isDone    = Output(Bool()) // `colour` is complete; it holds until the next `start`
  val colour    = Output(Rgb(FrameRegisters.colour))
  val isIllegal = Output(Bool()) // a word beyond the heap was read, for one cycle
}

/** Reads the texel of a hit: the one that its position is in. One hit at a time; latency: the memory's and one cycle.
  */
final class TextureLookup(config: PathConfig) extends Module {
  val io = IO(new TextureLookupIO(config))

  private val layout      = TextureLayout.of(config.device)
  private val response    = io.port.resp
  private val isRequested = RegInit(true.B)
  private val isDone      = RegInit(false.B)

  io.port.req.valid  := io.isKnown && !isRequested
  io.port.req.bits.x := io.position.r >> layout.fractionBits
  io.port.req.bits.y := io.position.g >> layout.fractionBits
  when(io.port.req.fire) { isRequested := true.B }
  when(response.valid) { isDone := true.B }
  when(io.start) {
    isRequested := false.B
    isDone      := false.B
  }

  private val texel = RegEnable(response.bits.colour, response.valid)
  io.isDone    := isDone
  io.isIllegal := response.valid && response.bits.isIllegal
  io.colour.channels.zip(Seq(texel.r, texel.g, texel.b)).foreach { case (to, from) => to := from }
}

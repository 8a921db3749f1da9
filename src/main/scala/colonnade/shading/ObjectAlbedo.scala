package colonnade.shading

import chisel3._
import chisel3.util.{Decoupled, Queue, RegEnable, Valid}
import colonnade.common.ReservedQueue
import colonnade.config.{PathConfig, TextureLayout}
import colonnade.formats.{AlbedoEntry, FrameRegisters, Material, Rgb}

/** Albedos that do not come from the material: by hit the interpolated colour, by textured hit the texel. */
final class AlbedoSources(config: PathConfig) extends Bundle {
  val colour = Option.when(config.device.geometry.cornerColours)(Valid(Rgb(FrameRegisters.colour)))
  val texel  = config.device.geometry.texture.map(_ => Valid(Rgb(FrameRegisters.colour)))
}

/** The albedo of the first of the hits whose sources are queued; a part of the module that has the queue of hits.
  *
  * @param material     of the first hit
  * @param hasMaterial  it is no point of the environment
  * @param takes        the first hit leaves
  * @param places       of the queues
  */
final private[shading] class ObjectAlbedo(
    config:      PathConfig,
    sources:     AlbedoSources,
    material:    Material,
    hasMaterial: Bool,
    takes:       Bool,
    places:      Int
) {
  private def queue(in: Valid[Rgb[UInt]], isTaken: Bool) = {
    val queue = Module(new ReservedQueue(Rgb(FrameRegisters.colour), places)).io
    queue.in          := in
    queue.out.ready   := isTaken
    queue.mayTakeNext := true.B
    queue.out
  }
  private val isTextured = material.hasTexture.map(_ && hasMaterial).getOrElse(false.B)
  private val colours    = sources.colour.map(queue(_, takes))
  private val texels     = sources.texel.map(queue(_, takes && isTextured))

  /** A textured hit waits for its texel. */
  val isKnown: Bool = texels.map(_.valid || !isTextured).getOrElse(true.B) && colours.map(_.valid).getOrElse(true.B)

  val albedo: Rgb[UInt] = WireInit(material.albedo)
  for (colour <- colours) when(material.hasCornerColours.get)(albedo := colour.bits)
  for (texel <- texels) when(isTextured)(albedo := texel.bits)
}

/** A hit with a texture. */
final class TexturedHit(config: PathConfig) extends Bundle {
  val position = new TexelPosition(TextureLayout.of(config.device))
  val isBounce = Bool() // its material is a mirror or glass
}

final class TexelReaderIO(config: PathConfig) extends Bundle {
  val hit  = Flipped(Valid(new TexturedHit(config))) // only while there is space
  val port = new TexturePort(config)

  // In the order of the hits of each kind
  val lit     = Valid(Rgb(FrameRegisters.colour))
  val bounced = Valid(Rgb(FrameRegisters.colour))

  val isIllegal = Output(Bool()) // a word beyond the heap was read, for one cycle
}

/** Reads the texels of hits. As many may be under way as have places. */
final class TexelReader(config: PathConfig, places: Int) extends Module {
  val io = IO(new TexelReaderIO(config))

  private val waiting = Module(new ReservedQueue(new TexturedHit(config), places)).io
  private val kinds   = Module(new Queue(Bool(), places)).io // of texels that are under way
  private val texel   = io.port.resp
  waiting.in          := io.hit
  waiting.mayTakeNext := true.B
  io.port.req.valid   := waiting.out.valid
  io.port.req.bits    := waiting.out.bits.position
  waiting.out.ready   := io.port.req.ready
  kinds.enq.valid     := io.port.req.fire
  kinds.enq.bits      := waiting.out.bits.isBounce
  kinds.deq.ready     := texel.valid
  for ((to, isOfKind) <- Seq(io.lit -> !kinds.deq.bits, io.bounced -> kinds.deq.bits)) {
    to.valid := texel.valid && isOfKind
    val colour = texel.bits.colour
    to.bits.channels.zip(Seq(colour.r, colour.g, colour.b)).foreach { case (channel, from) => channel := from }
  }
  io.isIllegal := texel.valid && texel.bits.isIllegal
}

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

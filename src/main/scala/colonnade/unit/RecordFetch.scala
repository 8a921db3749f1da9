package colonnade.unit

import chisel3._
import chisel3.util.{
  log2Ceil,
  Decoupled,
  Mux1H,
  MuxLookup,
  OHToUInt,
  PopCount,
  PriorityEncoder,
  PriorityEncoderOH,
  RegEnable,
  Valid
}
import colonnade.common.Context
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordBroadcast, RecordFormats, RecordRequest, SceneMap}

/** What a context wants a record for: the unit that takes it. */
object RecordUse extends ChiselEnum {
  val node, triangles, attributes = Value
}

/** A context that needs a record. */
final class RecordWish(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val use     = RecordUse()
  val address = UInt(RecordFormats.idBits(config).W)
}

/** A record for the context that wished for it. */
final class ServedRecord(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val use     = RecordUse()
  val address = UInt(RecordFormats.addressBits(config).W)
  val record  = new RecordFormats(config).record
}

/** An address outside the section of its use; the context gets nothing. */
final class RefusedWish(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val use     = RecordUse()
}

/** Gets contexts the records they wait for.
  *
  * A read is asked for only once a record buffer is reserved for it, so a broadcast never has to wait. With snooping,
  * every waiting context takes a matching record, as it arrives or from a buffer, and a buffer takes any broadcast that a
  * context waits for, whoever had asked for it; a buffer keeps its record until another needs the place. Without, a
  * context takes only the answer to its own read.
  *
  * Who is served is decided one cycle before: `chosen` is then the address of whatever is known of the context, and
  * `served` comes with the record from a register. A unit therefore says in which cycles it will take a record in the
  * next one, and keeps to it. Triangles go first and nodes last, for the triangle unit can begin only in every fourth
  * cycle, and the shader's wishes are few.
  *
  * A record is served at the earliest two cycles after its broadcast, and two cycles after the wish if a buffer has it.
  */
final class RecordFetch(config: ColonnadeConfig) extends Module {
  private val contexts = config.array.contexts
  private val snooping = config.columnBvhMemory.snooping.B

  val io = IO(new Bundle {

    /** Forget what the buffers hold: the memory may have changed. */
    val start      = Input(Bool())
    val row        = Input(UInt(log2Ceil(config.array.rows.max(2)).W))
    val scene      = Input(new SceneMap(RecordFormats.idBits(config)))
    val wishes     = Flipped(Vec(3, Valid(new RecordWish(config))))
    val requests   = Decoupled(new RecordRequest(config))
    val broadcasts = Flipped(Vec(config.columnBvhMemory.banks, Valid(new RecordBroadcast(config))))

    /** Units that take a record in the next cycle if there is one, one for each [[RecordUse]]. */
    val takesNext = Input(Vec(RecordUse.all.size, Bool()))

    /** Who is served in the next cycle; and who is in this one, and with what. */
    val chosen  = Output(Valid(Context(config)))
    val served  = Output(Valid(new ServedRecord(config)))
    val refused = Output(Valid(new RefusedWish(config)))

    /** Contexts without, and with, the record they wished for; records taken without having been asked for. */
    val waiting   = Output(UInt(log2Ceil(contexts + 1).W))
    val holding   = Output(UInt(log2Ceil(contexts + 1).W))
    val snoopHits = Output(UInt(log2Ceil(contexts + 1).W))
  })

  private object BufferState extends ChiselEnum {
    val empty, reserved, full = Value
  }
  private final class RecordBuffer {
    val state   = RegInit(BufferState.empty)
    val address = Reg(UInt(RecordFormats.addressBits(config).W))
    val record  = Reg(new RecordFormats(config).record)
  }
  private final class ContextWish {
    val isWaiting = RegInit(false.B)

    /** Outside its section: it waits to be refused, and takes no record, whatever the buffers hold. */
    val isIllegal = RegInit(false.B)
    val hasRecord = RegInit(false.B)
    val isAsked   = Reg(Bool())
    val use       = Reg(RecordUse())
    val address   = Reg(UInt(RecordFormats.idBits(config).W))
    val buffer    = Reg(UInt(log2Ceil(config.columnBvhMemory.recordBuffers.max(2)).W))
  }
  private val buffers = Seq.fill(config.columnBvhMemory.recordBuffers)(new RecordBuffer)
  private val wishes  = Seq.fill(contexts)(new ContextWish)

  /** Sections follow one another, and a face's address is never below theirs. */
  private def isInSection(address: UInt, use: RecordUse.Type): Bool = {
    val isNode = address < io.scene.triangleBase
    MuxLookup(use, address < io.scene.recordCount)(
      Seq(RecordUse.node -> isNode, RecordUse.triangles -> (!isNode && address < io.scene.attributeBase))
    )
  }

  /** The answer to a context's own read is, or comes, into buffer `index`. */
  private def isOwn(wish: ContextWish, index: Int): Bool = wish.isAsked && wish.buffer === index.U

  // Contexts take what they wait for from full buffers
  private val takes = wishes.map(wish =>
    buffers.zipWithIndex.map { case (buffer, index) =>
      val isMeant = Mux(snooping, wish.address === buffer.address, isOwn(wish, index))
      wish.isWaiting && buffer.state === BufferState.full && isMeant
    }
  )

  // Buffers that nobody needs any more may be filled anew
  private val isAvailable = buffers.zipWithIndex.map { case (buffer, index) =>
    val isHeld = wishes.zip(takes).map { case (wish, taken) =>
      taken(index) || (wish.hasRecord && wish.buffer === index.U)
    }
    buffer.state === BufferState.empty || (buffer.state === BufferState.full && !isHeld.reduce(_ || _))
  }

  // Broadcasts: into the buffer reserved for them, else (snooping) into an available one when a context waits for them
  private val awaited =
    io.broadcasts.map(broadcast => wishes.map(wish => wish.isWaiting && wish.address === broadcast.bits.address))
  private val (afterBroadcasts, fills) =
    io.broadcasts.zip(awaited).foldLeft((isAvailable, Seq.empty[Seq[Bool]])) {
      case ((available, fills), (broadcast, isAwaited)) =>
        val isReserved = buffers.map(buffer =>
          buffer.state === BufferState.reserved && buffer.address === broadcast.bits.address &&
            (snooping || broadcast.bits.row === io.row)
        )
        val isWanted  = isAwaited.zip(takes).map { case (waits, taken) => waits && !taken.reduce(_ || _) }
        val isSnooped = snooping && !isReserved.reduce(_ || _) && isWanted.reduce(_ || _)
        val places    = PriorityEncoderOH(available).map(_ && isSnooped && broadcast.valid)
        val meant     = PriorityEncoderOH(isReserved).map(_ && broadcast.valid)
        val filled    = places.zip(meant).map { case (place, mine) => place || mine }
        (available.zip(places).map { case (free, place) => free && !place }, fills :+ filled)
    }

  for ((buffer, fill) <- buffers.zip(fills.transpose)) {
    val broadcast = Mux1H(fill, io.broadcasts.map(_.bits))
    when(fill.reduce(_ || _)) {
      buffer.state   := BufferState.full
      buffer.address := broadcast.address
      buffer.record  := broadcast.record
    }
  }

  // A context has what a buffer had or has just got
  private val finds = wishes.zipWithIndex.map { case (wish, context) =>
    buffers.indices.map { index =>
      val arrives = fills.zip(awaited).map { case (filled, isAwaited) =>
        filled(index) && Mux(snooping, isAwaited(context), wish.isWaiting && isOwn(wish, index))
      }
      takes(context)(index) || arrives.reduce(_ || _)
    }
  }
  wishes.zip(finds).foreach { case (wish, found) =>
    when(found.reduce(_ || _)) {
      wish.isWaiting := false.B
      wish.hasRecord := true.B
      wish.buffer    := PriorityEncoder(found)
    }
  }
  io.snoopHits := PopCount(wishes.zip(finds).map { case (wish, found) => found.reduce(_ || _) && !wish.isAsked })

  // Ask for the record of one context that no buffer has or expects
  private val isCovered = wishes.map(wish =>
    Mux(
      snooping,
      buffers.map(buffer => buffer.state =/= BufferState.empty && wish.address === buffer.address).reduce(_ || _),
      wish.isAsked
    )
  )
  private val seekers = PriorityEncoderOH(wishes.zip(isCovered).map { case (wish, covered) =>
    wish.isWaiting && !covered
  })
  private val isSeeking = seekers.reduce(_ || _)
  private val address   = Mux1H(seekers, wishes.map(_.address))
  private val places    = PriorityEncoderOH(afterBroadcasts)

  // What is just arriving need not be asked for
  private val isArriving = io.broadcasts.map(broadcast => broadcast.valid && broadcast.bits.address === address)
  io.requests.valid        := isSeeking && places.reduce(_ || _) && !(snooping && isArriving.reduce(_ || _))
  io.requests.bits.address := address
  when(io.requests.fire) {
    buffers.zip(places).foreach { case (buffer, place) =>
      when(place) {
        buffer.state   := BufferState.reserved
        buffer.address := address
      }
    }
    wishes.zip(seekers).foreach { case (wish, seeks) =>
      when(seeks) {
        wish.isAsked := true.B
        wish.buffer  := PriorityEncoder(places)
      }
    }
  }

  // Refuse what lies outside its section
  private val illegal = PriorityEncoderOH(wishes.map(_.isIllegal))
  io.refused.valid        := illegal.reduce(_ || _)
  io.refused.bits.context := OHToUInt(illegal)
  io.refused.bits.use     := RecordUse.safe(Mux1H(illegal, wishes.map(_.use.asUInt)))._1
  wishes.zip(illegal).foreach { case (wish, isRefused) => when(isRefused) { wish.isIllegal := false.B } }

  // Choose a context for each use, and of these one whose unit will be ready. Its record may be replaced while it is
  // served, for it leaves its buffer in that cycle
  private val isServable = wishes.zip(takes).map { case (wish, taken) => wish.hasRecord || taken.reduce(_ || _) }
  private val foremost   = RecordUse.all.map { use =>
    PriorityEncoderOH(wishes.zip(isServable).map { case (wish, servable) => servable && wish.use === use })
  }
  private val chosenUse = {
    val isWanted = foremost.zip(io.takesNext).map { case (ones, takes) => ones.reduce(_ || _) && takes }
    PriorityEncoderOH(RecordFetch.precedence.map(isWanted(_)))
      .zip(RecordFetch.precedence)
      .sortBy { case (_, use) => use }
      .map { case (isChosen, _) => isChosen }
  }
  private val chosenOnes = foremost.transpose.map(_.zip(chosenUse).map { case (one, use) => one && use }.reduce(_ || _))
  private val chosenPlace = buffers.indices.map { index =>
    wishes.zip(takes).zip(chosenOnes).map { case ((wish, taken), isChosen) =>
      isChosen && Mux(wish.hasRecord, wish.buffer === index.U, PriorityEncoderOH(taken)(index))
    }.reduce(_ || _)
  }
  io.chosen.valid := chosenUse.reduce(_ || _)
  io.chosen.bits  := OHToUInt(chosenOnes)
  wishes.zip(chosenOnes).foreach { case (wish, isChosen) => when(isChosen) { wish.hasRecord := false.B } }

  // Serve it
  private val place = RegEnable(VecInit(chosenPlace), io.chosen.valid)
  io.served.valid        := RegNext(io.chosen.valid, false.B)
  io.served.bits.context := RegEnable(io.chosen.bits, io.chosen.valid)
  io.served.bits.use     := RecordUse.safe(RegEnable(OHToUInt(chosenUse), io.chosen.valid))._1
  io.served.bits.address := Mux1H(place, buffers.map(_.address))
  io.served.bits.record  := Mux1H(place, buffers.map(_.record))

  // New wishes
  for {
    port <- io.wishes
    isLegal = isInSection(port.bits.address, port.bits.use)
    (wish, context) <- wishes.zipWithIndex
  } {
    when(port.valid && port.bits.context === context.U) {
      wish.isWaiting := isLegal
      wish.isIllegal := !isLegal
      wish.isAsked   := false.B
      wish.use       := port.bits.use
      wish.address   := port.bits.address
    }
  }
  when(io.start) { buffers.foreach(_.state := BufferState.empty) }

  io.waiting := PopCount(wishes.map(_.isWaiting))
  io.holding := PopCount(wishes.map(_.hasRecord) :+ io.served.valid)
}

object RecordFetch {

  /** Uses of records, the most urgent first. */
  private val precedence: Seq[Int] =
    Seq(RecordUse.triangles, RecordUse.attributes, RecordUse.node).map(_.litValue.toInt)
}
